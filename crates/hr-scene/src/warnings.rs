//! Warnings, counted by what they say.

use crate::Warning;
use std::collections::HashMap;

/// Collects warnings in the order in which they came first.
#[derive(Debug, Default)]
pub(crate) struct Warnings {
    list: Vec<Warning>,
    index: HashMap<String, usize>,
}

impl Warnings {
    /// Notes what was mended or left out at a place; equal texts are counted. What decoders say may have several lines.
    pub(crate) fn add(&mut self, text: impl Into<String>, place: impl FnOnce() -> String) {
        let text: String = text.into().trim().replace(char::is_control, " ");
        if let Some(&i) = self.index.get(&text) {
            self.list[i].count = self.list[i].count.saturating_add(1);
        } else {
            self.index.insert(text.clone(), self.list.len());
            self.list.push(Warning { text, first: place(), count: 1 });
        }
    }

    /// The warnings.
    pub(crate) fn into_list(self) -> Vec<Warning> {
        self.list
    }
}
