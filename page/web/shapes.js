// The geometry and material of each group of parts.

import * as THREE from "three";
import { themeColour } from "./theme.js";

// Above these numbers of parts, round shapes get fewer triangles.
const FINE_PARTS = 3000;
const GROUND_SIZE = 4000;
// The classes of `Colour` of pbig-scenes, in their order. Fixed parts are ground or walls.
const COLOURS = ["--ground", "--ball", "--cuboid", "--slab", "--capsule", "--other"];
const OPACITY = 0.4;

const unitGeometries = {
    ball: (fine) => new THREE.SphereGeometry(1, fine ? 20 : 10, fine ? 14 : 7),
    cuboid: () => new THREE.BoxGeometry(2, 2, 2),
    cylinder: (fine) => new THREE.CylinderGeometry(1, 1, 2, fine ? 20 : 10),
    "half-space": () => new THREE.PlaneGeometry(GROUND_SIZE, GROUND_SIZE).rotateX(-Math.PI / 2),
};

/** Creates the mesh of a group, whose instances have no place yet. */
export function createMesh(group, meshes) {
    const geometry = group.kind === "mesh" ? meshGeometry(meshes[group.mesh]) : unitGeometry(group);
    const mesh = new THREE.InstancedMesh(geometry, material(group), group.count);
    mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
    // The bounding sphere of the instances would have to follow them.
    mesh.frustumCulled = false;
    mesh.castShadow = !group.isTranslucent && group.kind !== "half-space";
    mesh.receiveShadow = !group.isTranslucent;
    return mesh;
}

/** Sets the colour of each instance from its class. */
export function colourInstances(mesh, classes) {
    const palette = COLOURS.map((name) => new THREE.Color(themeColour(name)));
    if (mesh.material.transparent) palette[0].set(themeColour("--wall"));
    const shaded = new THREE.Color();
    classes.forEach((number, at) => {
        // Neighbours differ a little in lightness.
        const shade = number === 0 ? 1 : 0.82 + 0.09 * ((at * 7) % 5);
        mesh.setColorAt(at, shaded.copy(palette[number]).multiplyScalar(shade));
    });
    mesh.instanceColor.needsUpdate = true;
}

function unitGeometry({ kind, count }) {
    return unitGeometries[kind](count <= FINE_PARTS);
}

function meshGeometry({ coordinates, indices }) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(coordinates, 3));
    geometry.setIndex(new THREE.BufferAttribute(indices, 1));
    geometry.computeVertexNormals();
    return geometry;
}

function material({ kind, isTranslucent }) {
    const side = kind === "mesh" ? THREE.DoubleSide : THREE.FrontSide;
    const seeThrough = { transparent: true, opacity: OPACITY, depthWrite: false };
    return new THREE.MeshLambertMaterial({ side, ...(isTranslucent && seeThrough) });
}
