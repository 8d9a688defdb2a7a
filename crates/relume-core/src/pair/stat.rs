//! temp
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
pub const K: usize = 16;
#[allow(clippy::declare_interior_mutable_const)]
const Z: AtomicU64 = AtomicU64::new(0);
pub static N: [AtomicU64; K] = [Z; K];
pub static B: [AtomicU64; K] = [Z; K];
pub static NS: [AtomicU64; K] = [Z; K];
pub static HIST: [AtomicU64; 24] = [Z; 24];
pub static HISTNS: [AtomicU64; 24] = [Z; 24];
thread_local!{pub static LAST: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };}
pub fn add(k: usize, ns: u64) {
    let b = LAST.replace(0);
    N[k].fetch_add(1, Relaxed); B[k].fetch_add(b, Relaxed); NS[k].fetch_add(ns, Relaxed);
    let h = (64 - b.leading_zeros()) as usize;
    HIST[h].fetch_add(1, Relaxed); HISTNS[h].fetch_add(ns, Relaxed);
    let t: u64 = N.iter().map(|n| n.load(Relaxed)).sum();
    if t.is_power_of_two() && t > 10000 || t % 500_000 == 0 { print(); }
}
pub fn print() {
    for s in 0..2 { for (j, name) in ["ee","e-narrow","e-wide","g-e","g-g","g-wide","light","cluster"].iter().enumerate() {
        let k = s * 8 + j; let n = N[k].load(Relaxed);
        if n > 0 { eprintln!("{} {name}: {n} pairs, {:.1} blockers, {:.2} s, {:.1} us each", ["coarse","fine"][s], B[k].load(Relaxed) as f64 / n as f64, NS[k].load(Relaxed) as f64 * 1e-9, NS[k].load(Relaxed) as f64 * 1e-3 / n as f64); }
    }}
    for h in 0..24 { let n = HIST[h].load(Relaxed); if n > 0 { eprintln!("  blockers < {}: {n} pairs {:.2} s", 1u64 << h, HISTNS[h].load(Relaxed) as f64 * 1e-9); } }
    eprintln!();
}
