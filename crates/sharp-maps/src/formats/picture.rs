//! Decoding of map images into grey values, with checks that the decoders do not make.
//!
//! A PGM that was saved with CR LF line ends is shifted by one byte, and one that was cut is read without complaint by
//! many tools; both are refused here. Bytes after the last pixel, which some tools write, are warned about.

use std::io::Cursor;

use image::codecs::pnm::PnmDecoder;
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::error::MapError;
use super::load::check_size;

/// Decoded images above this are refused: the largest map in 8-bit RGBA.
const DECODED_BYTES_MAX: u64 = 1 << 28;

/// An image in 8-bit grey, row 0 at the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GreyImage {
    /// Columns.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// 0 is black, row-major from the upper-left pixel.
    pub(crate) grey: Vec<u8>,
    /// Which pixels are not fully opaque; `None` if the image has no alpha channel.
    pub(crate) transparent: Option<Vec<bool>>,
    /// What is odd about the file.
    pub(crate) warning: Option<String>,
}

/// Returns true if `bytes` begin like an image that [`decode`] knows.
pub(crate) fn is_picture(bytes: &[u8]) -> bool {
    format_of(bytes).is_some()
}

/// Decodes PNG, BMP and PNM (P1 to P6), told apart by their first bytes.
pub(crate) fn decode(file: &str, bytes: &[u8]) -> Result<GreyImage, MapError> {
    let mut warning = None;
    let image = match format_of(bytes) {
        Some(ImageFormat::Pnm) => decode_pnm(file, bytes, &mut warning)?,
        Some(format) => {
            if format == ImageFormat::Png {
                check_palette(file, bytes)?;
            }
            let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
            reader.limits(limits());
            let decoder = reader.into_decoder().map_err(|e| MapError::image(file, reason(&e)))?;
            from_decoder(file, decoder)?
        }
        None => {
            return Err(MapError::image(file, "is no PNG, PGM or BMP image: its first bytes are unknown"));
        }
    };
    Ok(GreyImage { warning, ..to_grey(image) })
}

fn format_of(bytes: &[u8]) -> Option<ImageFormat> {
    match bytes {
        [b'P', b'1'..=b'6', b' ' | b'\t' | b'\n' | b'\r' | b'#', ..] => Some(ImageFormat::Pnm),
        [0x89, b'P', b'N', b'G', ..] => Some(ImageFormat::Png),
        [b'B', b'M', ..] => Some(ImageFormat::Bmp),
        _ => None,
    }
}

/// Refuses a palette (chunk `PLTE`) that does not hold whole colours.
///
/// The standard asks for three bytes a colour (ISO/IEC 15948, 11.2.2), and the decoder of png 0.18.1 panics on others.
fn check_palette(file: &str, png: &[u8]) -> Result<(), MapError> {
    const SIGNATURE: usize = 8;
    const CHECKSUM: usize = 4;
    let mut rest = png.get(SIGNATURE..).unwrap_or_default();
    while let Some((&[a, b, c, d, ref name @ ..], data)) = rest.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        if name == b"PLTE" && !length.is_multiple_of(3) {
            return Err(MapError::image(
                file,
                format!("its palette has {length} bytes, must have 3 for each colour"),
            ));
        }
        rest = data.get(length.saturating_add(CHECKSUM)..).unwrap_or_default();
    }
    Ok(())
}

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(DECODED_BYTES_MAX);
    limits
}

fn from_decoder(file: &str, mut decoder: impl ImageDecoder) -> Result<DynamicImage, MapError> {
    let (width, height) = decoder.dimensions();
    check_size(file, width as usize, height as usize)?;
    let refused = |e: &image::ImageError| MapError::image(file, reason(e));
    decoder.set_limits(limits()).map_err(|e| refused(&e))?;
    limits().reserve(decoder.total_bytes()).map_err(|e| refused(&e))?;
    DynamicImage::from_decoder(decoder).map_err(|e| refused(&e))
}

fn decode_pnm(file: &str, bytes: &[u8], warning: &mut Option<String>) -> Result<DynamicImage, MapError> {
    let mut cursor = Cursor::new(bytes);
    let decoder = PnmDecoder::new(&mut cursor).map_err(|e| MapError::image(file, reason(&e)))?;
    let image = from_decoder(file, decoder)?;
    let rest = &bytes[cursor.position() as usize..];
    let is_ascii = bytes[1] <= b'3';
    if is_ascii && rest.iter().all(u8::is_ascii_whitespace) || rest.is_empty() {
        return Ok(image);
    }
    // A bitmap packs eight pixels of a row into a byte.
    let pixel_bytes = match bytes[1] {
        b'4' => image.height() as usize * (image.width() as usize).div_ceil(8),
        _ => image.as_bytes().len(),
    };
    let first_pixel = bytes.len().saturating_sub(rest.len() + pixel_bytes);
    let ends_in_cr_lf = first_pixel > 0 && bytes[first_pixel - 1..].starts_with(b"\r\n");
    if ends_in_cr_lf {
        return Err(MapError::image(file, "its header ends in CR LF, must end in a single white space"));
    }
    *warning = Some(format!("has {} bytes after the last pixel, they are not read", rest.len()));
    Ok(image)
}

fn to_grey(image: DynamicImage) -> GreyImage {
    let (width, height) = (image.width() as usize, image.height() as usize);
    if let DynamicImage::ImageLuma8(grey) = image {
        return GreyImage { width, height, grey: grey.into_raw(), transparent: None, warning: None };
    }
    let transparent =
        image.color().has_alpha().then(|| image.pixels().map(|(_, _, rgba)| rgba[3] < 255).collect());
    let grey = image.pixels().map(|(_, _, rgba)| intensity(rgba.0)).collect();
    GreyImage { width, height, grey, transparent, warning: None }
}

/// Grey value of a colour with the weights of the image library behind Nav2 (ITU-R BT.601).
fn intensity([red, green, blue, _]: [u8; 4]) -> u8 {
    let weighted = 306 * u32::from(red) + 601 * u32::from(green) + 117 * u32::from(blue);
    ((weighted + 512) / 1024) as u8
}

fn reason(error: &image::ImageError) -> String {
    match error {
        image::ImageError::Limits(_) => format!("needs more than {DECODED_BYTES_MAX} bytes when decoded"),
        image::ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            "ends before its last pixel".to_owned()
        }
        other => format!("cannot be decoded: {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A PNG of the given header whose raw scan lines are stored, not compressed.
    struct Png {
        size: (u32, u32),
        depth: u8,
        color: u8,
        interlaced: bool,
        /// Chunks between header and pixels.
        extra: Vec<(&'static [u8; 4], Vec<u8>)>,
        /// Each line begins with a 0 for "no filter".
        lines: Vec<u8>,
    }

    const GREY: u8 = 0;
    const PALETTE: u8 = 3;
    const GREY_ALPHA: u8 = 4;
    const RGBA: u8 = 6;

    impl Png {
        fn new(size: (u32, u32), depth: u8, color: u8, lines: &[u8]) -> Self {
            Self { size, depth, color, interlaced: false, extra: Vec::new(), lines: lines.to_vec() }
        }

        fn bytes(&self) -> Vec<u8> {
            let mut header = Vec::new();
            header.extend(self.size.0.to_be_bytes());
            header.extend(self.size.1.to_be_bytes());
            header.extend([self.depth, self.color, 0, 0, u8::from(self.interlaced)]);
            let length = self.lines.len() as u16;
            let mut zlib = vec![0x78, 0x01, 1];
            zlib.extend(length.to_le_bytes());
            zlib.extend((!length).to_le_bytes());
            zlib.extend(&self.lines);
            zlib.extend(adler32(&self.lines).to_be_bytes());
            let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
            push_chunk(&mut bytes, b"IHDR", &header);
            for (name, data) in &self.extra {
                push_chunk(&mut bytes, name, data);
            }
            push_chunk(&mut bytes, b"IDAT", &zlib);
            push_chunk(&mut bytes, b"IEND", &[]);
            bytes
        }

        fn grey(&self) -> (Vec<u8>, Option<Vec<bool>>) {
            let picture = decode("image.png", &self.bytes()).unwrap_or_else(|e| panic!("{e}"));
            (picture.grey, picture.transparent)
        }
    }

    fn push_chunk(bytes: &mut Vec<u8>, name: &[u8; 4], data: &[u8]) {
        bytes.extend((data.len() as u32).to_be_bytes());
        let start = bytes.len();
        bytes.extend(name);
        bytes.extend(data);
        let crc = bytes[start..].iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
        });
        bytes.extend((!crc).to_be_bytes());
    }

    fn adler32(data: &[u8]) -> u32 {
        let (a, b) = data.iter().fold((1_u32, 0_u32), |(a, b), &byte| {
            let a = (a + u32::from(byte)) % 65_521;
            (a, (a + b) % 65_521)
        });
        b << 16 | a
    }

    fn refusal(bytes: &[u8]) -> String {
        decode("image.png", bytes).expect_err("a broken image").to_string()
    }

    #[test]
    fn kinds_of_png_give_the_same_grey() {
        let grey = Png::new((2, 2), 8, GREY, &[0, 0, 255, 0, 100, 7]);
        assert_eq!(grey.grey(), (vec![0, 255, 100, 7], None), "8-bit grey");
        let deep = Png::new((2, 1), 16, GREY, &[0, 0x64, 0x64, 0xff, 0xff]);
        assert_eq!(deep.grey().0, [100, 255], "16-bit grey");
        let mut palette = Png::new((2, 1), 8, PALETTE, &[0, 1, 0]);
        palette.extra.push((b"PLTE", vec![0, 0, 0, 255, 0, 0]));
        assert_eq!(palette.grey(), (vec![76, 0], None), "red and black from a palette");
        palette.extra.push((b"tRNS", vec![255, 128]));
        assert_eq!(palette.grey().1, Some(vec![true, false]), "a palette with alpha");
        let alpha = Png::new((2, 1), 8, GREY_ALPHA, &[0, 9, 255, 9, 254]);
        assert_eq!(alpha.grey(), (vec![9, 9], Some(vec![false, true])), "grey with alpha");
        let color = Png::new((2, 1), 8, RGBA, &[0, 0, 255, 0, 255, 0, 0, 255, 0]);
        assert_eq!(color.grey(), (vec![150, 29], Some(vec![false, true])), "green and blue");
        let mut interlaced = Png::new((2, 2), 8, GREY, &[0, 0, 0, 255, 0, 100, 7]);
        interlaced.interlaced = true;
        assert_eq!(interlaced.grey().0, [0, 255, 100, 7], "interlaced");
    }

    #[test]
    fn sizes_are_refused_before_pixels_are_decoded() {
        for size in [(0, 0), (40_000, 40_000), (32_767, 32_767), (65_535, 65_537), (u32::MAX >> 1, 1)] {
            let message = refusal(&Png::new(size, 8, GREY, &[0]).bytes());
            assert!(message.starts_with("image.png: "), "{size:?}: {message}");
        }
        let message = refusal(&Png::new((8192, 8192), 16, RGBA, &[0]).bytes());
        assert!(message.contains("needs more than 268435456 bytes"), "{message}");
    }

    #[test]
    fn palettes_of_broken_colors_are_refused() {
        for length in 1..=10 {
            let mut png = Png::new((2, 1), 8, PALETTE, &[0, 0, 0]);
            png.extra.push((b"gAMA", vec![0, 0, 0xb1, 0x8f]));
            png.extra.push((b"PLTE", vec![7; length]));
            let decoded = decode("image.png", &png.bytes());
            if length % 3 == 0 {
                decoded.unwrap_or_else(|e| panic!("{length} bytes: {e}"));
                continue;
            }
            let message = decoded.expect_err("not whole colors").to_string();
            let wanted = format!("its palette has {length} bytes, must have 3 for each colour");
            assert!(message.contains(&wanted), "{length} bytes: {message}");
        }
    }

    #[test]
    fn cut_pngs_are_refused() {
        let bytes = Png::new((2, 2), 8, GREY, &[0, 0, 255, 0, 100, 7]).bytes();
        let pixels_end = bytes.len() - 12 - 4;
        for length in 0..pixels_end {
            refusal(&bytes[..length]);
        }
        for broken in 33..pixels_end {
            let mut bytes = bytes.clone();
            bytes[broken] ^= 1;
            // A flipped bit may hit nothing that matters; it must not panic.
            let _ = decode("image.png", &bytes);
        }
    }

    #[test]
    fn bitmaps_are_read_and_bombs_refused() {
        let bmp = |width: u32, height: u32| {
            let mut bytes = b"BM".to_vec();
            for word in [62_u32, 0, 54, 40, width, height, 0x18_0001, 0, 8, 0, 0, 0, 0] {
                bytes.extend(word.to_le_bytes());
            }
            bytes.extend([255, 255, 255, 0, 0, 0, 0, 0]);
            bytes
        };
        assert_eq!(decode("image.bmp", &bmp(2, 1)).expect("sound").grey, [255, 0], "white, black");
        refusal(&bmp(40_000, 40_000));
        refusal(&bmp(0, 1));
        refusal(&bmp(2, 1)[..56]);
    }
}
