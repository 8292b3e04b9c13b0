//! Functions that `run.mjs` calls, with integers only: no binding generator is needed.
//!
//! A call leaves a text behind: the first failure, or the message of a panic.

use crate::{Fault, notice, run};
use std::sync::{Mutex, MutexGuard, PoisonError};

static TEXT: Mutex<String> = Mutex::new(String::new());
static CASES: Mutex<u32> = Mutex::new(0);
static WORLD: Mutex<String> = Mutex::new(String::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the messages of panics, which end the module, as the text.
#[unsafe(no_mangle)]
pub extern "C" fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| *lock(&TEXT) = panic.to_string()));
}

/// Runs the corpus and the rapier world, and returns the number of failed cases.
#[unsafe(no_mangle)]
pub extern "C" fn run_cases() -> u32 {
    let outcome = run();
    *lock(&CASES) = outcome.cases;
    *lock(&WORLD) = outcome.world;
    *lock(&TEXT) = outcome.first;
    outcome.failed
}

/// Returns the number of cases in the last run.
#[unsafe(no_mangle)]
pub extern "C" fn case_count() -> u32 {
    *lock(&CASES)
}

/// Leaves behind what happened in the rapier world.
#[unsafe(no_mangle)]
pub extern "C" fn describe_world() {
    lock(&TEXT).clone_from(&lock(&WORLD));
}

/// Returns the number of faults that can be planted.
#[unsafe(no_mangle)]
pub extern "C" fn fault_count() -> u32 {
    Fault::PLANTED.len() as u32
}

/// Runs the cases with a planted fault and returns 1 if the checks notice it, 0 otherwise.
#[unsafe(no_mangle)]
pub extern "C" fn run_with_fault(number: u32) -> u32 {
    let fault = Fault::PLANTED.get(number as usize).copied().unwrap_or(Fault::None);
    let noticed = notice(fault);
    *lock(&TEXT) = noticed.clone().unwrap_or_else(|| format!("{fault:?}"));
    u32::from(noticed.is_some())
}

/// Returns the address of the text, in UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn text_address() -> *const u8 {
    lock(&TEXT).as_ptr()
}

/// Returns the length of the text in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    lock(&TEXT).len()
}
