//! The wire format of protocol buffers, as far as ONNX needs it.

/// A message that is being written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Message {
    bytes: Vec<u8>,
}

/// How a field is laid out.
#[derive(Clone, Copy)]
enum WireType {
    Varint = 0,
    Bytes = 2,
}

impl Message {
    /// A message without fields.
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// The message with a whole number in `field`.
    pub(crate) fn number(mut self, field: u32, number: u64) -> Self {
        self.key(field, WireType::Varint);
        varint(&mut self.bytes, number);
        self
    }

    /// The message with bytes in `field`.
    pub(crate) fn bytes(mut self, field: u32, bytes: &[u8]) -> Self {
        self.key(field, WireType::Bytes);
        varint(&mut self.bytes, bytes.len() as u64);
        self.bytes.extend(bytes);
        self
    }

    /// The message with text in `field`.
    pub(crate) fn text(self, field: u32, text: &str) -> Self {
        self.bytes(field, text.as_bytes())
    }

    /// The message with another one in `field`.
    pub(crate) fn message(self, field: u32, message: &Self) -> Self {
        self.bytes(field, &message.bytes)
    }

    /// Its bytes.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn key(&mut self, field: u32, wire: WireType) {
        varint(&mut self.bytes, u64::from(field << 3 | wire as u32));
    }
}

/// Seven bits a byte, the lowest first; the top bit says that more follow.
fn varint(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_a_key_and_a_value() {
        let inner = Message::new().number(1, 300);
        let message = Message::new().message(3, &inner).text(2, "ab");
        let expected = [0x1a, 3, 0x08, 0xac, 2, 0x12, 2, b'a', b'b'];
        assert_eq!(message.finish(), expected);
    }
}
