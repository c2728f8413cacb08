//! Drawn exports.

use super::{export, exported, folder, machine, names};
use image::AnimationDecoder;
use std::fs::File;
use std::io::BufReader;

fn can_draw(test: &str) -> bool {
    tenter::app::gpu::Gpu::offscreen().map_err(|e| machine::lacks(test, &e.to_string())).is_ok()
}

#[test]
fn pictures_are_numbered_and_seen_from_one_place() {
    if !can_draw("pictures_are_numbered_and_seen_from_one_place") {
        return;
    }
    let dir = folder();
    let options = ["flag", "--seconds", "0.4", "--fps", "10", "--size", "160x100", "--out", "a.png"];
    assert_eq!(exported(dir.path(), &options)["frames"], 5);
    let folder = dir.path().join("a");
    assert_eq!(names(&folder), ["a_0000.png", "a_0001.png", "a_0002.png", "a_0003.png", "a_0004.png"]);
    let pictures: Vec<_> =
        names(&folder).iter().map(|name| image::open(folder.join(name)).unwrap().to_rgb8()).collect();
    assert!(pictures.iter().all(|p| p.dimensions() == (160, 100)));
    let differ = |a: &[u8], b: &[u8]| a.chunks(3).zip(b.chunks(3)).filter(|(a, b)| a != b).count();
    for pair in pictures.windows(2) {
        // The cloth moves a little; the camera, which would change nearly every pixel of ground and cloth, does not.
        let changed = differ(&pair[0], &pair[1]);
        assert!((50..8000).contains(&changed), "{changed} of 16000 pixels change");
    }
}

#[test]
fn a_gif_plays_as_long_as_the_motion() {
    if !can_draw("a_gif_plays_as_long_as_the_motion") {
        return;
    }
    let dir = folder();
    let options = ["flag", "--seconds", "0.4", "--fps", "30", "--size", "80x50", "--out", "a.gif"];
    assert_eq!(exported(dir.path(), &options)["frames"], 13);
    let file = BufReader::new(File::open(dir.path().join("a.gif")).unwrap());
    let frames = image::codecs::gif::GifDecoder::new(file).unwrap().into_frames().collect_frames().unwrap();
    assert_eq!(frames.len(), 13);
    let delays: Vec<u32> = frames.iter().map(|f| f.delay().numer_denom_ms()).map(|(n, d)| n / d).collect();
    // 30 a second are 33.3 ms, of which GIF counts 30 or 40.
    assert!(delays.iter().all(|d| [30, 40].contains(d)), "{delays:?}");
    assert_eq!(delays.iter().sum::<u32>(), 430);
    assert!(frames.iter().all(|f| f.buffer().dimensions() == (80, 50)));

    let fast = export(dir.path(), &["flag", "--seconds", "1", "--fps", "60", "--out", "b.gif"]);
    assert!(
        String::from_utf8_lossy(&fast.stderr).contains("a GIF of 60 frames a second; accepted: up to 50")
    );
    assert_eq!(fast.status.code(), Some(1));
    assert_eq!(names(dir.path()), ["a.gif"]);
}
