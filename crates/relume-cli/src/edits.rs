//! Changes to a scene asked for on the command line: `--emit`, `--reflect`, `--hide`.
//!
//! Text to numbers; what they do to a scene is the engine's ([`relume::scene::Edits`]).

use std::fmt;
use std::str::FromStr;

use clap::Args;
use relume::scene::Edits;

use crate::failure::Failure;

/// What is changed of a scene before it is built.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct EditFlags {
    /// Makes a material emit: radiance in W/m2/sr, one number or r,g,b, in place of what the file says.
    /// Names as `relume info` lists them; * stands for any characters. May be repeated.
    #[arg(long, value_name = "MATERIAL=RADIANCE")]
    pub(crate) emit: Vec<Assignment>,
    /// Sets the diffuse reflectance of a material: one number or r,g,b, from 0 up to but not including 1.
    /// May be repeated.
    #[arg(long, value_name = "MATERIAL=R")]
    pub(crate) reflect: Vec<Assignment>,
    /// Leaves out a node with all below it (lights and cameras too); * stands for any characters. May be
    /// repeated.
    #[arg(long, value_name = "NODE")]
    pub(crate) hide: Vec<String>,
}

impl EditFlags {
    /// As the engine takes them.
    pub(crate) fn edits(&self) -> Edits {
        let pairs = |list: &[Assignment]| list.iter().map(|a| (a.name.clone(), a.rgb)).collect();
        Edits { hide: self.hide.clone(), emit: pairs(&self.emit), reflect: pairs(&self.reflect) }
    }

    /// As on the command line, for reports: nothing where nothing is changed.
    pub(crate) fn described(&self) -> Vec<String> {
        let hide = self.hide.iter().map(|name| format!("--hide {name}"));
        let emit = self.emit.iter().map(|a| format!("--emit {a}"));
        let reflect = self.reflect.iter().map(|a| format!("--reflect {a}"));
        hide.chain(emit).chain(reflect).collect()
    }

    /// An error if anything is changed: of a scene that is not from a file.
    pub(crate) fn refuse_for_a_demo(&self) -> Result<(), Failure> {
        match self.described().first() {
            None => Ok(()),
            Some(edit) => Err(Failure::usage(format_args!("{edit} goes with a scene from a file"))
                .help("write the demonstration with `relume demo` and name its .glb")),
        }
    }
}

/// `NAME=NUMBER` or `NAME=R,G,B`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Assignment {
    name: String,
    rgb: [f64; 3],
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Assignment, String> {
        // Names may hold anything, numbers no `=`.
        let (name, numbers) = text.rsplit_once('=').filter(|(name, _)| !name.is_empty()).ok_or(
            "write the name of a material, =, and one number or three: lamp=40 or lamp=40,36,30",
        )?;
        let channels: Result<Vec<f64>, _> = numbers.split(',').map(|n| n.trim().parse()).collect();
        let wrong = || format!("`{numbers}` is neither one number nor three: r,g,b");
        let rgb = match channels.map_err(|_| wrong())?[..] {
            [grey] => [grey; 3],
            [r, g, b] => [r, g, b],
            _ => return Err(wrong()),
        };
        if rgb.iter().any(|c| !(c.is_finite() && *c >= 0.0)) {
            return Err("give finite numbers of 0 or more".into());
        }
        Ok(Assignment { name: name.to_owned(), rgb })
    }
}

impl fmt::Display for Assignment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.rgb;
        if r == g && g == b {
            write!(f, "{}={r}", self.name)
        } else {
            write!(f, "{}={r},{g},{b}", self.name)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers() {
        let read = |text: &str| text.parse::<Assignment>().map(|a| (a.name, a.rgb));
        assert_eq!(read("lamp=40"), Ok(("lamp".into(), [40.0; 3])));
        assert_eq!(read("a=b=1,2, 0.5"), Ok(("a=b".into(), [1.0, 2.0, 0.5])));
        for wrong in
            ["lamp", "=4", "lamp=", "lamp=1,2", "lamp=1,2,3,4", "lamp=-1", "lamp=NaN", "lamp=x"]
        {
            assert!(read(wrong).is_err(), "{wrong}");
        }
        for text in ["lamp=40", "lamp=1,2,0.5"] {
            assert_eq!(text.parse::<Assignment>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn reports_say_what_was_changed() {
        let emit = vec!["lamp=4".parse().unwrap()];
        let flags = EditFlags { emit, reflect: Vec::new(), hide: vec!["roof".into()] };
        assert_eq!(flags.described(), ["--hide roof", "--emit lamp=4"]);
        assert_eq!(flags.edits().emit, [("lamp".to_owned(), [4.0; 3])]);
        assert!(EditFlags::default().described().is_empty());
    }
}
