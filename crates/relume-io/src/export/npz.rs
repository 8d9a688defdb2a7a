//! Arrays as NumPy reads them: `.npz`, a zip archive of `.npy` files, not compressed.
//!
//! Knows arrays of numbers and text, nothing of what they mean. Format: NumPy Enhancement Proposal
//! 1, `numpy.lib.format` version 1.0.

use std::io::{self, Seek, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// What an array is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// 64-bit floats.
    Float,
    /// 64-bit integers.
    Int,
    /// Text of so many characters, in UTF-32.
    Text(usize),
    /// So many bytes.
    Bytes(usize),
}

impl Kind {
    /// The type's name in NumPy, little endian.
    fn descriptor(self) -> String {
        match self {
            Kind::Float => "<f8".into(),
            Kind::Int => "<i8".into(),
            // NumPy has no text of no characters.
            Kind::Text(n) => format!("<U{}", n.max(1)),
            Kind::Bytes(n) => format!("|S{}", n.max(1)),
        }
    }
}

/// An archive being written, one array after the other.
pub struct Npz<W: Write + Seek> {
    zip: ZipWriter<W>,
}

impl<W: Write + Seek> Npz<W> {
    /// Starts an archive.
    pub fn new(to: W) -> Npz<W> {
        Npz { zip: ZipWriter::new(to) }
    }

    fn begin(&mut self, name: &str, kind: Kind, shape: &[usize]) -> io::Result<()> {
        // Entries may grow beyond 4 GiB; without a date they are the same bytes every time.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(true);
        self.zip.start_file(format!("{name}.npy"), options)?;
        let axes: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
        let mut header = format!(
            "{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}",
            kind.descriptor(),
            axes.concat()
        );
        // Data begin at a multiple of 64 bytes.
        const BEFORE: usize = 10;
        while !(BEFORE + header.len() + 1).is_multiple_of(64) {
            header.push(' ');
        }
        header.push('\n');
        self.zip.write_all(b"\x93NUMPY\x01\x00")?;
        self.zip.write_all(&(header.len() as u16).to_le_bytes())?;
        self.zip.write_all(header.as_bytes())
    }

    /// Begins an array of floats in row order; [`Npz::more_floats`] fills it, as many as the shape
    /// has room for.
    pub fn begin_floats(&mut self, name: &str, shape: &[usize]) -> io::Result<()> {
        self.begin(name, Kind::Float, shape)
    }

    /// Goes on with the array that was begun last.
    pub fn more_floats(&mut self, values: &[f64]) -> io::Result<()> {
        self.words(values.iter().map(|v| v.to_le_bytes()))
    }

    /// An array of floats in row order.
    pub fn floats(&mut self, name: &str, shape: &[usize], values: &[f64]) -> io::Result<()> {
        self.begin_floats(name, shape)?;
        self.more_floats(values)
    }

    /// An array of whole numbers in row order.
    pub fn ints(&mut self, name: &str, shape: &[usize], values: &[i64]) -> io::Result<()> {
        self.begin(name, Kind::Int, shape)?;
        self.words(values.iter().map(|v| v.to_le_bytes()))
    }

    /// A list of texts.
    pub fn texts(&mut self, name: &str, values: &[String]) -> io::Result<()> {
        let longest = values.iter().map(|v| v.chars().count()).max().unwrap_or(0).max(1);
        self.begin(name, Kind::Text(longest), &[values.len()])?;
        for value in values {
            let padded = value.chars().map(u32::from).chain(std::iter::repeat(0)).take(longest);
            self.words(padded.map(u32::to_le_bytes))?;
        }
        Ok(())
    }

    /// A single piece of bytes, without an axis.
    pub fn bytes(&mut self, name: &str, value: &[u8]) -> io::Result<()> {
        self.begin(name, Kind::Bytes(value.len()), &[])?;
        self.zip.write_all(value)
    }

    fn words<const N: usize>(&mut self, words: impl Iterator<Item = [u8; N]>) -> io::Result<()> {
        let mut buffer = Vec::with_capacity(1 << 16);
        for word in words {
            buffer.extend_from_slice(&word);
            if buffer.len() + N > 1 << 16 {
                self.zip.write_all(&buffer)?;
                buffer.clear();
            }
        }
        self.zip.write_all(&buffer)
    }

    /// Ends the archive; hands back what it was written to.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.zip.finish()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Read};

    fn entry(archive: &[u8], name: &str) -> Vec<u8> {
        let mut zip = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
        let mut bytes = Vec::new();
        zip.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
        bytes
    }

    fn header(npy: &[u8]) -> (&str, &[u8]) {
        assert_eq!(&npy[..8], b"\x93NUMPY\x01\x00");
        let len = usize::from(u16::from_le_bytes([npy[8], npy[9]]));
        assert_eq!((10 + len) % 64, 0);
        (std::str::from_utf8(&npy[10..10 + len]).unwrap().trim_end(), &npy[10 + len..])
    }

    #[test]
    fn arrays_have_numpys_header_and_row_order() {
        let mut npz = Npz::new(Cursor::new(Vec::new()));
        npz.floats("a", &[2, 1], &[1.0, -0.5]).unwrap();
        npz.ints("n", &[3], &[1, 2, -3]).unwrap();
        npz.texts("names", &["wall".into(), "\u{e9}t".into()]).unwrap();
        npz.bytes("format", b"csr").unwrap();
        let archive = npz.finish().unwrap().into_inner();
        let a = entry(&archive, "a.npy");
        let (text, data) = header(&a);
        assert_eq!(text, "{'descr': '<f8', 'fortran_order': False, 'shape': (2,1,), }");
        assert_eq!(data, [1.0_f64.to_le_bytes(), (-0.5_f64).to_le_bytes()].concat());
        let n = entry(&archive, "n.npy");
        let (text, data) = header(&n);
        assert!(text.contains("'<i8'") && text.contains("(3,)") && data.len() == 24, "{text}");
        let names = entry(&archive, "names.npy");
        let (text, data) = header(&names);
        assert!(text.contains("'<U4'") && data.len() == 32, "{text}");
        assert_eq!(data[16..24], [0xe9, 0, 0, 0, b't', 0, 0, 0]);
        let format = entry(&archive, "format.npy");
        let (text, data) = header(&format);
        assert!(text.contains("'|S3'") && text.contains("'shape': ()"), "{text}");
        assert_eq!(data, b"csr");
    }
}
