//! Named contexts: the vertices, colours and materials that a file has defined, and which one is current.

use super::fault::{Fault, fault};
use crate::error::quoted;
use std::collections::HashMap;

/// Contexts of one kind.
#[derive(Debug)]
pub(super) struct Contexts<T> {
    /// What the entity is called: `v`, `c` or `m`.
    keyword: &'static str,
    /// What it means, for messages.
    noun: &'static str,
    names: HashMap<String, usize>,
    /// The unnamed context first.
    values: Vec<(String, T)>,
    current: usize,
}

impl<T: Clone + Default> Contexts<T> {
    pub(super) fn new(keyword: &'static str, noun: &'static str) -> Self {
        Self { keyword, noun, names: HashMap::new(), values: vec![("unnamed".into(), T::default())], current: 0 }
    }

    /// Executes `v`, `c` or `m`: `keyword [name [= [template]]]`.
    pub(super) fn select(&mut self, words: &[&str]) -> Result<(), Fault> {
        match *words {
            [] => {
                self.values[0].1 = T::default();
                self.current = 0;
            }
            [name] => self.current = self.find(name)?,
            // A context that is its own template stays as it is.
            [name, "=", template] if name == template => self.current = self.find(name)?,
            [name, "="] => self.define(name, T::default()),
            [name, "=", template] => {
                let value = self.values[self.find(template)?].1.clone();
                self.define(name, value);
            }
            _ => {
                let keyword = self.keyword;
                return fault(
                    format!("this is no {} context", self.noun),
                    format!(
                        "write `{keyword}`, `{keyword} name`, `{keyword} name =` or `{keyword} name = template`, \
                         comments on lines of their own"
                    ),
                );
            }
        }
        Ok(())
    }

    fn define(&mut self, name: &str, value: T) {
        let next = self.values.len();
        self.current = *self.names.entry(name.to_owned()).or_insert(next);
        if self.current == next {
            self.values.push((name.to_owned(), value));
        } else {
            self.values[self.current].1 = value;
        }
    }

    fn find(&self, name: &str) -> Result<usize, Fault> {
        match self.names.get(name) {
            Some(&index) => Ok(index),
            None => fault(
                format!("undefined {} {}", self.noun, quoted(name)),
                format!("define it with `{} {} =` before use", self.keyword, quoted(name).trim_matches('\'')),
            ),
        }
    }

    /// The value of a named context.
    pub(super) fn get(&self, name: &str) -> Result<&T, Fault> {
        Ok(&self.values[self.find(name)?].1)
    }

    /// The current context.
    pub(super) fn current(&self) -> &T {
        &self.values[self.current].1
    }

    /// The current context, to be changed.
    pub(super) fn current_mut(&mut self) -> &mut T {
        &mut self.values[self.current].1
    }

    /// Name of the current context.
    pub(super) fn current_name(&self) -> &str {
        &self.values[self.current].0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contexts(script: &[(&str, Option<i32>)]) -> Contexts<i32> {
        let mut contexts = Contexts::new("c", "colour");
        for (words, value) in script {
            contexts.select(&words.split_whitespace().collect::<Vec<_>>()).expect("valid");
            if let Some(value) = value {
                *contexts.current_mut() = *value;
            }
        }
        contexts
    }

    #[test]
    fn names_templates_and_the_unnamed_one() {
        let c = contexts(&[("", Some(1)), ("a =", Some(2)), ("b = a", None), ("a", Some(3))]);
        assert_eq!((c.get("a"), c.get("b")), (Ok(&3), Ok(&2)), "a copy is on its own");
        let c = contexts(&[("a =", Some(2)), ("a = a", None)]);
        assert_eq!(c.get("a"), Ok(&2), "its own template");
        let c = contexts(&[("a =", Some(2)), ("a =", None)]);
        assert_eq!(c.get("a"), Ok(&0), "anew");
        let c = contexts(&[("", Some(1)), ("a =", Some(2)), ("", None)]);
        assert_eq!((*c.current(), c.current_name()), (0, "unnamed"), "the unnamed one starts anew");
    }

    #[test]
    fn what_is_wrong_and_what_would_be_right() {
        let mut c = contexts(&[("a =", None)]);
        for (words, what, mend) in [
            (&["b"][..], "undefined colour 'b'", "`c b =`"),
            (&["a", "=", "b"], "undefined colour 'b'", "`c b =`"),
            (&["b", "=", "b"], "undefined colour 'b'", "`c b =`"),
            (&["a", "b"], "no colour context", "`c name = template`"),
            (&["a", "=", "a", "a"], "no colour context", "`c name = template`"),
        ] {
            let fault = c.select(words).expect_err("invalid");
            assert!(fault.what.contains(what) && fault.mend.contains(mend), "{words:?}: {fault:?}");
        }
    }
}
