//! The corpus and the rapier world in a native program: for processors that an emulator runs.

fn main() {
    println!("{}", pbig_wasm::run());
}
