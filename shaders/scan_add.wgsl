// Map, step 5: computes the start of each cell's entries from the start within its block. The counts of the cell become
// cursors for the scatter: the end of the residents, and the end of the visitors behind them.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> cells: array<Cell>;

const CELLS_PER_BLOCK = 1024u;

@compute @workgroup_size(LANES)
fn scan_add(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) lane: u32) {
    let cell = linear(group, groups) * LANES + lane;
    if cell < params.cells {
        let start = starts[cell] + sums[cell / CELLS_PER_BLOCK];
        let end = start + cells[cell].residents;
        starts[cell] = start;
        cells[cell] = Cell(end, end + cells[cell].visitors);
    }
}
