//! A .glb file as its JSON and its bytes.

use serde_json::Value;

/// Packs a file (glTF 2.0, section 4.4).
pub(crate) fn pack(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let word = |n: usize| (n as u32).to_le_bytes();
    let total = word(12 + 8 + text.len() + 8 + bin.len());
    let head = [&b"glTF"[..], &word(2), &total, &word(text.len()), b"JSON"].concat();
    [&head[..], &text, &word(bin.len()), b"BIN\0", &bin].concat()
}

/// The JSON and the bytes of a file that is right.
pub(crate) fn unpack(file: &[u8]) -> (Value, Vec<u8>) {
    let length = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let (text, bin) = (length(12), 20 + length(12));
    (serde_json::from_slice(&file[20..20 + text]).unwrap(), file[bin + 8..][..length(bin)].to_vec())
}
