//! What the program is doing, how far it is, and how good the solution is: a bar on a terminal, else a few lines.

use hr_diffuse::Phase;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps of the bar.
const STEPS: u64 = 1000;

/// The bar is drawn at least this often, so that its clock does not seem to hang.
const TICK: Duration = Duration::from_millis(200);

/// Reports on standard error.
pub struct Progress {
    to: To,
    begin: Instant,
}

/// Without a terminal, activities shorter than this are not worth a line; so a mistake in the input is the only line.
const WORTH_A_LINE: Duration = Duration::from_secs(2);

enum To {
    Bar(ProgressBar),
    Lines(Mutex<Lines>),
}

/// What has been and is to be written.
struct Lines {
    activity: String,
    since: Instant,
    /// Whether the activity has its line already.
    written: bool,
    patience: Duration,
    out: Box<dyn Write + Send>,
}

impl Progress {
    /// A bar where standard error is a terminal, else plain lines, one per longer activity.
    #[must_use]
    pub fn new() -> Self {
        if !std::io::stderr().is_terminal() {
            return Self::lines(Box::new(std::io::stderr()), WORTH_A_LINE);
        }
        let bar = ProgressBar::new(STEPS);
        let template = "{msg:58!} {bar:24} {percent:>3} %  {elapsed}";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(TICK);
        Self { to: To::Bar(bar), begin: Instant::now() }
    }

    fn lines(out: Box<dyn Write + Send>, patience: Duration) -> Self {
        let begin = Instant::now();
        let lines = Lines { activity: String::new(), since: begin, written: true, patience, out };
        Self { to: To::Lines(Mutex::new(lines)), begin }
    }

    /// Says how far a solve is: links, and the relative error that the solution is believed to have.
    pub fn solving(&self, state: &hr_diffuse::Progress) {
        let detail = || format!(": {}", details(state));
        self.tell(phase(state), state.fraction, detail);
    }

    /// Says what is being done and how far it is (0…1). May be called often and from any thread.
    pub fn at(&self, activity: &str, fraction: f32) {
        self.tell(activity, fraction, String::new);
    }

    fn tell(&self, activity: &str, fraction: f32, detail: impl FnOnce() -> String) {
        match &self.to {
            To::Bar(bar) => {
                // Saturates; not-a-number is 0.
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0…STEPS")]
                bar.set_position((fraction.clamp(0.0, 1.0) * STEPS as f32) as u64);
                bar.set_message(format!("{activity}{}", detail()));
            }
            To::Lines(lines) => {
                let lines = &mut *lines.lock().unwrap_or_else(PoisonError::into_inner);
                if lines.activity != activity {
                    activity.clone_into(&mut lines.activity);
                    (lines.since, lines.written) = (Instant::now(), false);
                }
                if !lines.written && lines.since.elapsed() >= lines.patience {
                    lines.written = true;
                    write(&mut lines.out, activity);
                }
            }
        }
    }

    /// Says something that stays: a warning, a result.
    pub fn say(&self, text: &str) {
        match &self.to {
            To::Bar(bar) => bar.suspend(|| write(&mut std::io::stderr(), text)),
            To::Lines(lines) => write(&mut lines.lock().unwrap_or_else(PoisonError::into_inner).out, text),
        }
    }

    /// Takes the bar away before a window opens or the program ends.
    pub fn clear(&self) {
        if let To::Bar(bar) = &self.to {
            bar.finish_and_clear();
        }
    }

    /// Time since the start.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.begin.elapsed()
    }
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.clear();
    }
}

/// What the solver is doing, with the error that is believed to be left, and links.
pub(crate) fn activity(state: &hr_diffuse::Progress) -> String {
    format!("{}: {}", phase(state), details(state))
}

fn phase(state: &hr_diffuse::Progress) -> &'static str {
    match state.phase {
        Phase::Refine => "refining links",
        Phase::Transport => "transporting light",
        Phase::Reconstruct => "values at vertices",
        _ => "solving",
    }
}

fn details(state: &hr_diffuse::Progress) -> String {
    format!("{}, error about {:.2} %", links(state.links), 100.0 * state.error)
}

/// A number of links, short.
fn links(count: u64) -> String {
    match count {
        0..10_000 => format!("{count} links"),
        10_000..1_000_000 => format!("{} k links", count / 1000),
        _ => format!("{:.1} M links", count as f64 * 1e-6),
    }
}

/// Nobody may be listening; that is no reason to stop.
fn write(out: &mut impl Write, text: &str) {
    drop(writeln!(out, "hr-view: {text}"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn without_a_terminal_it_is_one_line_per_activity() {
        let out = Shared::default();
        let progress = Progress::lines(Box::new(out.clone()), Duration::ZERO);
        for i in 0..100_u8 {
            progress.at("refining", f32::from(i) / 100.0);
        }
        progress.say("one warning");
        progress.at("refining", 0.9);
        progress.at("transport", f32::NAN);
        progress.clear();
        let text = String::from_utf8(out.0.lock().unwrap_or_else(PoisonError::into_inner).clone());
        let expected = "hr-view: refining\nhr-view: one warning\nhr-view: transport\n";
        assert_eq!(text.as_deref(), Ok(expected), "three lines");
    }

    #[test]
    fn what_is_over_soon_is_not_mentioned() {
        let out = Shared::default();
        let progress = Progress::lines(Box::new(out.clone()), Duration::from_secs(3600));
        progress.at("loading", 0.0);
        progress.at("refining", 0.5);
        assert!(out.0.lock().unwrap_or_else(PoisonError::into_inner).is_empty(), "an hour has not passed");
    }
}
