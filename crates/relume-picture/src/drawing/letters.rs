//! Letters of straight strokes on a grid of 4 by 6.

/// Height of the letters, in units of the grid.
pub(super) const TALL: f64 = 6.0;

/// From one letter to the next.
pub(super) const ADVANCE: f64 = 5.6;

/// The strokes of a letter, as points (x, y) with y up from the base line.
pub(super) fn lines(letter: char) -> Vec<Vec<[f64; 2]>> {
    let digit = |b: u8| f64::from(b.saturating_sub(b'0'));
    let point = |word: &str| {
        let bytes = word.as_bytes();
        [digit(bytes[0]), digit(bytes[1])]
    };
    let line = |text: &str| text.split(' ').filter(|w| w.len() == 2).map(point).collect();
    strokes(letter.to_ascii_uppercase()).split('|').map(line).collect()
}

/// Points as two digits, strokes parted by bars.
fn strokes(letter: char) -> &'static str {
    match letter {
        'A' => "00 26 40|12 32",
        'B' => "03 33 42 41 30 00 06 36 45 44 33",
        'C' => "45 36 16 05 01 10 30 41",
        'D' => "00 06 26 44 42 20 00",
        'E' => "46 06 00 40|03 33",
        'F' => "46 06 00|03 33",
        'G' => "45 36 16 05 01 10 30 41 43 23",
        'H' => "00 06|40 46|03 43",
        'I' => "20 26|10 30|16 36",
        'J' => "46 41 30 10 01",
        'K' => "00 06|46 03 40",
        'L' => "06 00 40",
        'M' => "00 06 23 46 40",
        'N' => "00 06 40 46",
        'O' => "10 01 05 16 36 45 41 30 10",
        'P' => "00 06 36 45 44 33 03",
        'Q' => "10 01 05 16 36 45 41 30 10|22 40",
        'R' => "00 06 36 45 44 33 03|23 40",
        'S' => "45 36 16 05 04 13 33 42 41 30 10 01",
        'T' => "06 46|26 20",
        'U' => "06 01 10 30 41 46",
        'V' => "06 20 46",
        'W' => "06 10 23 30 46",
        'X' => "00 46|06 40",
        'Y' => "06 23 46|23 20",
        'Z' => "06 46 00 40",
        '0' => "10 01 05 16 36 45 41 30 10",
        '1' => "15 26 20|10 30",
        '2' => "05 16 36 45 44 00 40",
        '3' => "05 16 36 45 44 33 13|33 42 41 30 10 01",
        '4' => "30 36 02 42",
        '5' => "46 06 03 33 42 41 30 10 01",
        '6' => "45 36 16 05 01 10 30 41 42 33 03",
        '7' => "06 46 10",
        '8' => "13 04 05 16 36 45 44 33 13 02 01 10 30 41 42 33",
        '9' => "01 10 30 41 45 36 16 05 04 13 43",
        '.' => "20 21",
        ',' => "21 10",
        ':' => "21 22|24 25",
        '-' => "13 33",
        '=' => "02 42|04 44",
        '+' => "13 33|22 24",
        '<' => "35 13 31",
        '>' => "15 33 11",
        '/' => "00 46",
        '(' => "36 25 21 30",
        ')' => "16 25 21 10",
        '^' => "14 26 34",
        _ => "",
    }
}
