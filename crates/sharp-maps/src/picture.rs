//! Decoding of map images into grey values, with the checks that decoders leave out.
//!
//! A PGM that was saved with CR LF line ends is shifted by one byte, and one that was cut or
//! appended to is read without complaint by many tools; here the file must end where its header
//! says.

use std::io::Cursor;

use image::codecs::pnm::PnmDecoder;
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::error::MapError;
use crate::load::check_size;

/// Decoded images above this are refused: the largest map in 8-bit RGBA.
const DECODED_BYTES_MAX: u64 = 1 << 28;

/// An image in 8-bit grey, row 0 at the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Picture {
    /// Columns.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// 0 is black, row-major from the upper-left pixel.
    pub(crate) grey: Vec<u8>,
    /// Which pixels are not fully opaque; `None` if the image has no alpha channel.
    pub(crate) transparent: Option<Vec<bool>>,
}

/// Returns true if `bytes` begin like an image that [`decode`] knows.
pub(crate) fn is_picture(bytes: &[u8]) -> bool {
    format_of(bytes).is_some()
}

/// Decodes PNG, BMP and PNM (P1 to P6), told apart by their first bytes.
pub(crate) fn decode(file: &str, bytes: &[u8]) -> Result<Picture, MapError> {
    let image = match format_of(bytes) {
        Some(ImageFormat::Pnm) => decode_pnm(file, bytes)?,
        Some(format) => {
            let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
            reader.limits(limits());
            let decoder = reader.into_decoder().map_err(|e| MapError::image(file, reason(&e)))?;
            from_decoder(file, decoder)?
        }
        None => {
            return Err(MapError::image(file, "is no PNG, PGM or BMP image: its first bytes are unknown"));
        }
    };
    Ok(to_grey(image))
}

fn format_of(bytes: &[u8]) -> Option<ImageFormat> {
    match bytes {
        [b'P', b'1'..=b'6', b' ' | b'\t' | b'\n' | b'\r' | b'#', ..] => Some(ImageFormat::Pnm),
        [0x89, b'P', b'N', b'G', ..] => Some(ImageFormat::Png),
        [b'B', b'M', ..] => Some(ImageFormat::Bmp),
        _ => None,
    }
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

fn decode_pnm(file: &str, bytes: &[u8]) -> Result<DynamicImage, MapError> {
    let mut cursor = Cursor::new(bytes);
    let decoder = PnmDecoder::new(&mut cursor).map_err(|e| MapError::image(file, reason(&e)))?;
    let image = from_decoder(file, decoder)?;
    let rest = &bytes[cursor.position() as usize..];
    let is_ascii = bytes[1] <= b'3';
    if is_ascii && rest.iter().all(u8::is_ascii_whitespace) || rest.is_empty() {
        return Ok(image);
    }
    let first_pixel = bytes.len().saturating_sub(rest.len() + image.as_bytes().len());
    let ends_in_cr_lf = first_pixel > 0 && bytes[first_pixel - 1..].starts_with(b"\r\n");
    Err(MapError::image(
        file,
        if ends_in_cr_lf {
            "its header ends in CR LF, must end in a single white space".to_owned()
        } else {
            format!("has {} bytes after the last pixel, must have none", rest.len())
        },
    ))
}

fn to_grey(image: DynamicImage) -> Picture {
    let (width, height) = (image.width() as usize, image.height() as usize);
    if let DynamicImage::ImageLuma8(grey) = image {
        return Picture { width, height, grey: grey.into_raw(), transparent: None };
    }
    let transparent =
        image.color().has_alpha().then(|| image.pixels().map(|(_, _, rgba)| rgba[3] < 255).collect());
    let grey = image.pixels().map(|(_, _, rgba)| intensity(rgba.0)).collect();
    Picture { width, height, grey, transparent }
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
