//! Ctrl-C: the first one stops refining and shows what there is, the next one ends the program. No half file is left.

use hr_scene::whole_file::abandon;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// What Ctrl-C is answered with.
pub(crate) const STOPPING: &str = "stopping, this shows what there is; Ctrl-C again ends the program";

/// Where Ctrl-C does not stop a solve: it ends the program, as everywhere.
const ENDS: u8 = 0;
/// A solve is running that it can stop.
const STOPS: u8 = 1;
/// It has stopped the solve.
const STOPPED: u8 = 2;

/// Exit status of a program that Ctrl-C has ended, as shells expect it: 128 and the signal's number.
const STATUS: i32 = 130;

static STATE: AtomicU8 = AtomicU8::new(ENDS);
static HANDLER: OnceLock<()> = OnceLock::new();

/// As long as it lives, one Ctrl-C asks to stop instead of ending the program.
#[derive(Debug)]
pub struct Interrupt(());

impl Interrupt {
    /// From now on. Where the system lets nobody listen, Ctrl-C goes on ending the program.
    #[must_use]
    pub fn listen() -> Self {
        HANDLER.get_or_init(|| {
            // Handlers are for the whole process; another one's is left in place.
            drop(ctrlc::try_set_handler(|| {
                if STATE.compare_exchange(STOPS, STOPPED, Ordering::SeqCst, Ordering::SeqCst).is_err() {
                    let _held = abandon();
                    std::process::exit(STATUS);
                }
            }));
        });
        STATE.store(STOPS, Ordering::SeqCst);
        Self(())
    }

    /// Whether Ctrl-C has been pressed.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        STATE.load(Ordering::SeqCst) == STOPPED
    }
}

impl Drop for Interrupt {
    fn drop(&mut self) {
        STATE.store(ENDS, Ordering::SeqCst);
    }
}
