//! The page as a browser shows it, on a desk and on a telephone.

use super::tests::{page, recorded, tour};
use crate::tests::browser::{browser, title_after};

/// Opens the page in a frame of WIDTH x 800 pixels and uses it: pixels by which it is too wide, whether the map
/// has many colours, whether the pointer over the middle of the first guide shows its name, whether the arrow
/// keys move the map, whether time moves it, and how many buttons are smaller than a finger needs.
const FRAME: &str = r#"<!DOCTYPE html><title>waiting</title>
<iframe id="frame" src="page.html" style="border:0;width:WIDTHpx;height:800px"></iframe>
<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
frame.onload = async () => {
  const inner = frame.contentWindow, page = frame.contentDocument, root = page.documentElement;
  await wait(500);
  const canvas = page.getElementById('map');
  const colours = () => {
    const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data, seen = new Set();
    for (let i = 0; i < pixels.length; i += 4) seen.add(pixels[i] << 16 | pixels[i + 1] << 8 | pixels[i + 2]);
    return seen.size;
  };
  const picture = () => (inner.eval('drawNow()'), canvas.toDataURL());
  const many = colours() > 20;
  const guide = inner.eval('toScreen(guides[0][guides[0].length >> 1])'), box = canvas.getBoundingClientRect();
  const pointer = { clientX: box.left + guide[0], clientY: box.top + guide[1], pointerId: 1, bubbles: true };
  canvas.dispatchEvent(new inner.PointerEvent('pointermove', pointer));
  const tip = page.getElementById('tip'), named = !tip.hidden && tip.textContent.startsWith(inner.eval('legs[0].option'));
  canvas.dispatchEvent(new inner.PointerEvent('pointerleave', pointer));
  let before = picture();
  canvas.dispatchEvent(new inner.KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true }));
  const moves = picture() !== before;
  before = picture();
  const slider = page.getElementById('time');
  slider.value = 3;
  slider.dispatchEvent(new inner.Event('input'));
  const drives = picture() !== before;
  const small = [...page.querySelectorAll('button')].filter(it => it.getBoundingClientRect().height < 32).length;
  document.title = ['seen', root.scrollWidth - root.clientWidth, many, named, moves, drives, small].join(' ');
};
</script>"#;

#[test]
fn a_browser_shows_the_page_on_a_desk_and_on_a_telephone() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let tour = tour();
    std::fs::write(folder.path().join("page.html"), page(&tour, &recorded(&tour, 60.0))).expect("a file");
    for width_px in [1280, 390] {
        let frame = FRAME.replace("WIDTH", &width_px.to_string());
        let (seen, complaints) = title_after(browser, folder.path(), &frame);
        assert_eq!((&*seen, &*complaints), ("0 true true true true 0", ""), "at {width_px}");
    }
}
