//! What is wrong with a statement, and what would be right; the reader adds the place.

use crate::error::quoted;

/// An error without its place.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Fault {
    pub(super) what: String,
    pub(super) mend: String,
}

/// An error without its place.
pub(super) fn fault<T>(what: impl Into<String>, mend: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { what: what.into(), mend: mend.into() })
}

/// A finite number.
pub(super) fn number(word: &str) -> Result<f64, Fault> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => fault(format!("{} is not a finite number", quoted(word)), "write a number such as 2, -0.5 or 1e-3"),
    }
}

/// A whole number, 0 or more.
pub(super) fn count(word: &str) -> Result<u32, Fault> {
    match word.parse() {
        Ok(value) => Ok(value),
        Err(_) => {
            fault(format!("{} is not a whole number from 0 to {}", quoted(word), u32::MAX), "write a number such as 3")
        }
    }
}

/// Exactly `N` arguments.
pub(super) fn exactly<'a, const N: usize>(words: &[&'a str], usage: &str) -> Result<[&'a str; N], Fault> {
    match <[&str; N]>::try_from(words) {
        Ok(words) => Ok(words),
        Err(_) => fault(
            format!("{} where {N} belong", counted(words.len(), "argument")),
            format!("write `{usage}`, comments on lines of their own"),
        ),
    }
}

/// "1 argument", "2 arguments".
pub(super) fn counted(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// Exactly `N` finite numbers.
pub(super) fn numbers<const N: usize>(words: &[&str], usage: &str) -> Result<[f64; N], Fault> {
    let words = exactly::<N>(words, usage)?;
    let mut values = [0.0; N];
    for (value, word) in values.iter_mut().zip(words) {
        *value = number(word)?;
    }
    Ok(values)
}
