//! Link events as a table: one line an event.

use std::fmt::Write;

use relume::session::{Event, EventKind};

/// The lines so far, comma-separated values with a header.
pub(crate) struct EventTable {
    text: String,
}

impl EventTable {
    /// The header alone.
    pub(crate) fn new() -> EventTable {
        EventTable {
            text: "frame,kind,receiver,source,x_before_m2,v_before,x_after_m2,v_after\n".into(),
        }
    }

    /// Adds the events that led to a frame.
    pub(crate) fn add(&mut self, frame: u32, events: &[Event]) {
        for event in events {
            let ends = [event.receiver.short(), event.source.short()].map(|name| quoted(&name));
            let numbers = [event.before, event.after].map(|numbers| match numbers {
                Some((x, v)) => format!("{x:e},{v}"),
                None => ",".into(),
            });
            let kind = kind(event.kind);
            let _ = writeln!(
                self.text,
                "{frame},{kind},{},{},{},{}",
                ends[0], ends[1], numbers[0], numbers[1]
            );
        }
    }

    /// The table.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }
}

fn kind(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Promoted => "promoted",
        EventKind::Demoted => "demoted",
        EventKind::Occluded => "occluded",
        EventKind::Revealed => "revealed",
        EventKind::Culled => "culled",
        EventKind::Woken => "woken",
    }
}

/// A field of comma-separated values (RFC 4180).
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use relume::session::ElementName;

    use super::*;

    #[test]
    fn a_line_an_event() {
        let element = |surface: &str, path: &[u8]| ElementName::Element {
            body: "room".into(),
            surface: surface.into(),
            patch: Some(2),
            facet: None,
            path: path.to_vec(),
        };
        let mut table = EventTable::new();
        let event = |kind, before, after| Event {
            kind,
            receiver: element("wall, left", &[0, 3]),
            source: ElementName::Light("sun".into()),
            before,
            after,
        };
        table.add(
            3,
            &[
                event(EventKind::Demoted, Some((0.25, 0.5)), None),
                event(EventKind::Revealed, Some((1e-7, 0.0)), Some((1e-7, 1.0))),
            ],
        );
        let lines: Vec<&str> = table.text().lines().collect();
        assert_eq!(lines[1], "3,demoted,\"wall, left#2:0.3\",sun,2.5e-1,0.5,,");
        assert_eq!(lines[2], "3,revealed,\"wall, left#2:0.3\",sun,1e-7,0,1e-7,1");
        assert_eq!(lines.len(), 3);
    }
}
