// Draws the world.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { colourInstances, createMesh } from "./shapes.js";
import { Quality } from "./quality.js";
import { onThemeChange, themeColour } from "./theme.js";

const MATRIX_FLOATS = 16;
// Shadows draw every part twice.
const MAX_PARTS_WITH_SHADOWS = 4000;
const VIEW_DIRECTION = new THREE.Vector3(0.75, 0.45, 1).normalize();
// Things fall and spread: room for that.
const ROOM = 1.5;
// From the right, so that shadows lie where the camera sees them.
const SUN_DIRECTION = new THREE.Vector3(0.75, 1, -0.2).normalize();
const SHADOW_MAP_SIZE = 2048;

/** The canvas with the shapes, the camera and the lights. */
export class Stage {
    #renderer;
    #scene = new THREE.Scene();
    #camera = new THREE.PerspectiveCamera(40, 1, 0.1, 10000);
    #orbit;
    #sun = new THREE.DirectionalLight(0xffffff, 2.2);
    #sky = new THREE.HemisphereLight(0xffffff, 0x8088a0, 1.4);
    #shapes = [];
    #quality = new Quality();

    /** Throws if the canvas has no WebGL. */
    constructor(canvas, onContextLost) {
        this.#renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
        this.#orbit = new OrbitControls(this.#camera, canvas);
        this.#orbit.maxPolarAngle = Math.PI * 0.495;
        this.#sun.shadow.mapSize.set(SHADOW_MAP_SIZE, SHADOW_MAP_SIZE);
        this.#scene.add(this.#sun, this.#sun.target, this.#sky);
        this.#scene.fog = new THREE.Fog(0, 1, 2);
        canvas.addEventListener("webglcontextlost", onContextLost);
        new ResizeObserver(() => this.#fitCanvas()).observe(canvas.parentElement);
        onThemeChange(() => this.#applyTheme());
        this.#applyQuality();
    }

    /** Replaces the shapes. */
    setScenery({ groups, meshes, colours }) {
        this.#shapes.forEach(({ mesh }) => this.#discard(mesh));
        let first = 0;
        this.#shapes = groups.map((group) => {
            const shape = { mesh: createMesh(group, meshes), first, classes: colours.subarray(first, first + group.count) };
            first += group.count;
            return shape;
        });
        this.#scene.add(...this.#shapes.map(({ mesh }) => mesh));
        this.#applyQuality();
        this.#applyTheme();
    }

    /** Moves the shapes: 16 floats for each, in the order of the groups. */
    setMatrices(matrices) {
        for (const { mesh, first } of this.#shapes) {
            const floats = matrices.subarray(MATRIX_FLOATS * first, MATRIX_FLOATS * (first + mesh.count));
            mesh.instanceMatrix.array.set(floats);
            mesh.instanceMatrix.needsUpdate = true;
        }
    }

    /** Turns camera and sun to a box: the coordinates of its centre, and its half extents. */
    lookAt([x, y, z, halfX, halfY, halfZ]) {
        const radius = Math.max(Math.hypot(halfX, halfY, halfZ), 1);
        // Things fall: the ground below is as interesting as the place they start from.
        const target = new THREE.Vector3(x, y - 0.6 * halfY, z);
        const distance = (ROOM * radius) / Math.sin(this.#narrowAngle() / 2);
        this.#orbit.target.copy(target);
        this.#camera.position.copy(target).addScaledVector(VIEW_DIRECTION, distance);
        this.#camera.near = distance / 200;
        this.#camera.far = distance * 20;
        this.#camera.updateProjectionMatrix();
        this.#scene.fog.near = distance * 1.5;
        this.#scene.fog.far = distance * 6;
        this.#placeSun(target, radius);
    }

    /** Draws the shapes at their places, at this time in milliseconds. */
    draw(now) {
        if (this.#quality.noteFrame(now)) this.#applyQuality();
        this.#orbit.update();
        this.#renderer.render(this.#scene, this.#camera);
    }

    #placeSun(target, radius) {
        const reach = 2 * radius;
        this.#sun.target.position.copy(target);
        this.#sun.position.copy(target).addScaledVector(SUN_DIRECTION, 2 * reach);
        Object.assign(this.#sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, far: 5 * reach });
        this.#sun.shadow.camera.updateProjectionMatrix();
        this.#sun.shadow.normalBias = 0.02;
    }

    // The smaller of the angles across and along the canvas.
    #narrowAngle() {
        const vertical = THREE.MathUtils.degToRad(this.#camera.fov);
        return Math.min(vertical, 2 * Math.atan(Math.tan(vertical / 2) * this.#camera.aspect));
    }

    #fitCanvas() {
        const { clientWidth, clientHeight } = this.#renderer.domElement.parentElement;
        this.#renderer.setSize(clientWidth, clientHeight, false);
        this.#camera.aspect = clientWidth / Math.max(clientHeight, 1);
        this.#camera.updateProjectionMatrix();
    }

    #applyQuality() {
        const { hasShadows, maxPixelRatio } = this.#quality.level;
        const parts = this.#shapes.reduce((sum, { mesh }) => sum + mesh.count, 0);
        this.#sun.castShadow = hasShadows && parts <= MAX_PARTS_WITH_SHADOWS;
        this.#renderer.shadowMap.enabled = this.#sun.castShadow;
        this.#renderer.setPixelRatio(Math.min(devicePixelRatio, maxPixelRatio));
        this.#fitCanvas();
    }

    #applyTheme() {
        const sky = new THREE.Color(themeColour("--sky"));
        this.#scene.background = sky;
        this.#scene.fog.color.copy(sky);
        this.#shapes.forEach(({ mesh, classes }) => colourInstances(mesh, classes));
    }

    #discard(mesh) {
        this.#scene.remove(mesh);
        mesh.geometry.dispose();
        mesh.material.dispose();
        mesh.dispose();
    }
}
