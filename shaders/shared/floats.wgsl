// Floats and ordered integers. Bits only: what a device does to denormals, infinities and NaN is of no account.

// The ordered integers of both infinities. Those of NaN lie beyond.
const LOWEST = -0x7f800001;
const HIGHEST = 0x7f800000;

// Returns the ordered integer of a float's bits. Both zeros become one.
fn ordered(bits: i32) -> i32 {
    return select(bits ^ ((bits >> 31u) & 0x7fffffff), 0, bits == -0x7fffffff - 1);
}

// Returns a box of floats in ordered integers; an invalid one overlaps nothing.
fn ordered_box(raw: DeviceBox) -> DeviceBox {
    let low = vec3<i32>(ordered(raw.low[0]), ordered(raw.low[1]), ordered(raw.low[2]));
    let high = vec3<i32>(ordered(raw.high[0]), ordered(raw.high[1]), ordered(raw.high[2]));
    if all(low >= vec3<i32>(LOWEST)) && all(high <= vec3<i32>(HIGHEST)) && all(low <= high) {
        return DeviceBox(array<i32, 3>(low.x, low.y, low.z), array<i32, 3>(high.x, high.y, high.z));
    }
    return NOWHERE;
}
