//! Texts by number, in the order in which they are met first.

/// A place of the table that holds none.
const FREE: u32 = u32::MAX;
/// Of the hash: an odd number without a pattern, 2^64 through the golden ratio.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// Distinct texts, one behind the other, and a table, half of it free, to find them.
#[derive(Default)]
pub struct Interned {
    bytes: Vec<u8>,
    ends: Vec<usize>,
    /// Hash and number of a text at the first free place from its hash on.
    table: Vec<(u32, u32)>,
}

impl Interned {
    /// Return the number of a text.
    pub fn of(&mut self, text: &[u8]) -> i32 {
        if self.table.len() < 2 * (self.ends.len() + 1) {
            self.grow();
        }
        let own = hash(text);
        let mut at = own as usize;
        loop {
            at &= self.table.len() - 1;
            let (hash, number) = self.table[at];
            if number == FREE {
                break;
            }
            if hash == own && self.text(number as usize) == text {
                return number as i32;
            }
            at += 1;
        }
        let new = self.ends.len();
        self.table[at] = (own, new as u32);
        self.bytes.extend_from_slice(text);
        self.ends.push(self.bytes.len());
        new as i32
    }

    /// Go through the texts by their numbers.
    pub fn texts(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        (0..self.ends.len()).map(|number| self.text(number))
    }

    fn text(&self, number: usize) -> &[u8] {
        let begin = number.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.bytes[begin..self.ends[number]]
    }

    fn grow(&mut self) {
        let places = (2 * self.table.len()).max(64);
        let old = std::mem::replace(&mut self.table, vec![(0, FREE); places]);
        for (own, number) in old.into_iter().filter(|(_, number)| *number != FREE) {
            let mut at = own as usize & (places - 1);
            while self.table[at].1 != FREE {
                at = (at + 1) & (places - 1);
            }
            self.table[at] = (own, number);
        }
    }
}

/// Hash a text, eight bytes at a time.
fn hash(text: &[u8]) -> u32 {
    let mut hash = text.len() as u64;
    for eight in text.chunks(8) {
        let mut word = [0; 8];
        word[..eight.len()].copy_from_slice(eight);
        hash = (hash.rotate_left(23) ^ u64::from_le_bytes(word)).wrapping_mul(FACTOR);
    }
    (hash >> 32) as u32
}
