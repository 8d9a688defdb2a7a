//! Decoders of other libraries, which may panic on damaged bytes. The engine's own code must not, and is not run in here.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// What a decoder returns; `None` if it panics, which is not reported. What it may have left half done must be its own.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !QUIET.with(Cell::get) {
                report(info);
            }
        }));
    });
    let before = QUIET.with(|quiet| quiet.replace(true));
    let decoded = panic::catch_unwind(AssertUnwindSafe(decode)).ok();
    QUIET.with(|quiet| quiet.set(before));
    decoded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_no_answer() {
        assert_eq!(guarded(|| 3), Some(3));
        let bytes: &[u8] = &[];
        assert_eq!(guarded(|| bytes[std::hint::black_box(0)]), None);
        assert_eq!(guarded(|| 4), Some(4));
    }
}
