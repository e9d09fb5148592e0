//! Common data representation: how ROS 2 lays out messages in bytes.
//!
//! A payload begins with four bytes that say "plain CDR, little-endian". Each number is then aligned to its own size,
//! counted from after these four bytes. Text is its length with the zero at its end, its bytes, and the zero.

/// Writes one message.
#[derive(Clone, Debug)]
pub(crate) struct CdrWriter {
    bytes: Vec<u8>,
}

/// Plain CDR, little-endian, no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

impl CdrWriter {
    /// A message without content.
    pub(crate) fn new() -> Self {
        Self { bytes: ENCAPSULATION.to_vec() }
    }

    /// The payload.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn align(&mut self, size: usize) {
        let content = self.bytes.len() - ENCAPSULATION.len();
        self.bytes.resize(ENCAPSULATION.len() + content.next_multiple_of(size), 0);
    }

    fn put<const N: usize>(&mut self, number: [u8; N]) {
        self.align(N);
        self.bytes.extend(number);
    }

    pub(crate) fn i32(&mut self, number: i32) {
        self.put(number.to_le_bytes());
    }

    pub(crate) fn u32(&mut self, number: u32) {
        self.put(number.to_le_bytes());
    }

    pub(crate) fn f32(&mut self, number: f32) {
        self.put(number.to_le_bytes());
    }

    pub(crate) fn f64(&mut self, number: f64) {
        self.put(number.to_le_bytes());
    }

    pub(crate) fn f64s(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|&number| self.f64(number));
    }

    /// The length of a sequence whose elements follow.
    pub(crate) fn len(&mut self, count: usize) {
        self.u32(u32::try_from(count).expect("a message has fewer than 2^32 elements"));
    }

    pub(crate) fn string(&mut self, text: &str) {
        self.len(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    /// A sequence of signed bytes.
    pub(crate) fn i8s(&mut self, numbers: impl ExactSizeIterator<Item = i8>) {
        self.len(numbers.len());
        self.bytes.extend(numbers.map(|number| number.to_le_bytes()[0]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_after_the_header() {
        let mut writer = CdrWriter::new();
        writer.string("ab");
        writer.f64(1.0);
        writer.i8s([-1, 2].into_iter());
        writer.i32(-2);
        let expected: Vec<u8> = [
            &[0, 1, 0, 0][..],
            &[3, 0, 0, 0, b'a', b'b', 0, 0],
            &1.0_f64.to_le_bytes(),
            &[2, 0, 0, 0, 255, 2, 0, 0],
            &[254, 255, 255, 255],
        ]
        .concat();
        assert_eq!(writer.finish(), expected);
    }
}
