//! The default scene: a furnished room at dusk, 6 x 4.5 x 2.8 m, z up. A window in the back wall, five kinds of lamps, a
//! varnished plank floor that reflects them, and things of every shape there is.
//!
//! Solids stand a hair apart or cover faces that are left out, so that no two faces lie in one plane and overlap.

use super::build::{Builder, Paint, skip};
use crate::{Camera, Rgb, Scene};
use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};
use std::f64::consts::{PI, TAU};

/// Length, depth and height of the room.
const SIZE: DVec3 = DVec3::new(6.0, 4.5, 2.8);
/// The window's opening in the back wall.
const WINDOW_X: [f64; 2] = [3.0, 5.2];
const WINDOW_Z: [f64; 2] = [0.3, 2.3];
/// Thickness of the wall around the window.
const RECESS: f64 = 0.18;
const RUG_HEIGHT: f64 = 0.012;
const TABLE: DVec2 = DVec2::new(1.35, 3.4);
const TABLE_HEIGHT: f64 = 0.74;

/// Material indices.
struct Palette {
    planks: [u32; 3],
    white_wall: u32,
    terracotta_wall: u32,
    teal_wall: u32,
    ceiling: u32,
    white_paint: u32,
    sky: u32,
    bulb: u32,
    globe: u32,
    panel: u32,
    shade_white: u32,
    shade_red: u32,
    linen: u32,
    walnut: u32,
    oak: u32,
    chair_paint: u32,
    sofa: u32,
    cushion: u32,
    bolster: u32,
    rug: u32,
    brass: u32,
    chrome: u32,
    copper: u32,
    black_metal: u32,
    blue_glaze: u32,
    green_glaze: u32,
    porcelain: u32,
    clay: u32,
    soil: u32,
    leaf: u32,
    apple: u32,
    books: [u32; 4],
    art: [u32; 5],
}

impl Palette {
    fn new(b: &mut Builder) -> Self {
        let rgb = Rgb::new;
        let grey = Rgb::splat;
        let mut solid = |name: &str, paint: Paint| b.material(name, paint.solid());
        let plank = |tone: f32| Paint::glossy(rgb(0.40, 0.26, 0.15) * tone, grey(0.14), 0.06);
        let cloth = |r, g, b| Paint::diffuse(rgb(r, g, b));
        let varnish = |r, g, b, rs, alpha| Paint::glossy(rgb(r, g, b), grey(rs), alpha);
        Self {
            planks: [solid("plank light", plank(1.12)), solid("plank", plank(1.0)), solid("plank dark", plank(0.84))],
            white_wall: solid("white wall", cloth(0.70, 0.68, 0.62)),
            terracotta_wall: solid("terracotta wall", cloth(0.62, 0.33, 0.22)),
            teal_wall: solid("teal wall", cloth(0.17, 0.40, 0.42)),
            ceiling: solid("ceiling", cloth(0.80, 0.80, 0.78)),
            white_paint: solid("white paint", varnish(0.72, 0.71, 0.68, 0.04, 0.10)),
            sky: solid("sky", Paint::light(rgb(0.72, 0.92, 1.25) * 240.0)),
            bulb: solid("bulb", Paint::light(rgb(1.30, 0.95, 0.60) * 22_000.0)),
            globe: solid("opal globe", Paint::light(rgb(1.25, 0.96, 0.66) * 2_200.0)),
            panel: solid("ceiling lamp", Paint::light(rgb(1.20, 0.98, 0.74) * 1_800.0)),
            shade_white: solid("shade, inside", cloth(0.78, 0.76, 0.72)),
            shade_red: solid("shade, red", varnish(0.55, 0.07, 0.05, 0.05, 0.08)),
            linen: solid("shade, linen", cloth(0.68, 0.60, 0.46)),
            walnut: solid("walnut", varnish(0.17, 0.095, 0.055, 0.10, 0.06)),
            oak: solid("oak", varnish(0.45, 0.31, 0.19, 0.05, 0.12)),
            chair_paint: solid("chair paint", varnish(0.24, 0.34, 0.30, 0.05, 0.10)),
            sofa: solid("sofa", cloth(0.62, 0.44, 0.14)),
            cushion: solid("cushion", cloth(0.68, 0.50, 0.18)),
            bolster: solid("bolster", cloth(0.58, 0.14, 0.10)),
            rug: solid("rug", cloth(0.58, 0.52, 0.43)),
            brass: solid("brass", Paint::glossy(rgb(0.08, 0.06, 0.02), rgb(0.74, 0.58, 0.28), 0.08)),
            chrome: solid("chrome", varnish(0.03, 0.03, 0.03, 0.76, 0.05)),
            copper: solid("copper", Paint::glossy(rgb(0.07, 0.04, 0.03), rgb(0.74, 0.44, 0.32), 0.08)),
            black_metal: solid("black metal", varnish(0.05, 0.05, 0.055, 0.06, 0.10)),
            blue_glaze: solid("blue glaze", varnish(0.07, 0.14, 0.40, 0.07, 0.05)),
            green_glaze: solid("green glaze", varnish(0.12, 0.34, 0.20, 0.07, 0.05)),
            porcelain: solid("porcelain", varnish(0.74, 0.73, 0.70, 0.06, 0.05)),
            clay: solid("clay", cloth(0.52, 0.28, 0.18)),
            soil: solid("soil", cloth(0.07, 0.05, 0.04)),
            leaf: b.material("leaf", Paint::glossy(rgb(0.11, 0.30, 0.08), grey(0.04), 0.15)),
            apple: b.material("apple", Paint::glossy(rgb(0.50, 0.10, 0.06), grey(0.05), 0.08).solid()),
            books: [
                b.material("book, red", cloth(0.45, 0.10, 0.08).solid()),
                b.material("book, navy", cloth(0.08, 0.12, 0.28).solid()),
                b.material("book, ochre", cloth(0.60, 0.42, 0.16).solid()),
                b.material("book, grey", cloth(0.42, 0.44, 0.46).solid()),
            ],
            art: [
                b.material("paint, vermilion", cloth(0.70, 0.18, 0.10).solid()),
                b.material("paint, ultramarine", cloth(0.10, 0.16, 0.48).solid()),
                b.material("paint, yellow", cloth(0.78, 0.62, 0.14).solid()),
                b.material("paint, ivory", cloth(0.78, 0.74, 0.64).solid()),
                b.material("paint, black", cloth(0.05, 0.05, 0.05).solid()),
            ],
        }
    }
}

/// The furnished room.
pub(super) fn room() -> Scene {
    let mut b = Builder::new("room");
    let p = Palette::new(&mut b);
    shell(&mut b, &p);
    window(&mut b, &p);
    door(&mut b, &p);
    dining_corner(&mut b, &p);
    sofa_corner(&mut b, &p);
    left_wall(&mut b, &p);
    bookcase(&mut b, &p);
    plant(&mut b, &p, dvec3(2.66, 4.08, 0.0));
    ceiling_lamp(&mut b, &p, dvec2(3.3, 1.7));
    let camera = |eye, target, fov_x| Camera { eye, target, up: [0.0, 0.0, 1.0], fov_x, width: 640, height: 400 };
    b.camera("main", camera([0.36, 0.62, 1.50], [3.40, 3.15, 0.80], 72.0));
    b.camera("dining", camera([4.40, 0.95, 1.35], [1.55, 3.30, 0.82], 66.0));
    b.camera("window", camera([4.35, 3.85, 1.45], [0.95, 1.25, 0.78], 74.0));
    b.done()
}

/// Floor, walls, ceiling and baseboards.
fn shell(b: &mut Builder, p: &Palette) {
    const BOARDS: u32 = 20;
    let width = SIZE.x / f64::from(BOARDS);
    for k in 0..BOARDS {
        let (x0, x1) = (width * f64::from(k), width * f64::from(k + 1));
        // Joints staggered as floor layers do.
        let joint = [1.5, 3.0, 0.9, 2.4][k as usize % 4];
        for (part, [y0, y1]) in [[0.0, joint], [joint, SIZE.y]].into_iter().enumerate() {
            let tone = p.planks[(k as usize * 5 + part * 2 + k as usize / 3) % 3];
            b.quad(tone, [dvec3(x0, y0, 0.0), dvec3(x1, y0, 0.0), dvec3(x1, y1, 0.0), dvec3(x0, y1, 0.0)]);
        }
    }
    let (x, y, z) = (SIZE.x, SIZE.y, SIZE.z);
    b.quad(p.ceiling, [dvec3(0.0, 0.0, z), dvec3(0.0, y, z), dvec3(x, y, z), dvec3(x, 0.0, z)]);
    b.quad(p.terracotta_wall, [dvec3(0.0, 0.0, 0.0), dvec3(0.0, y, 0.0), dvec3(0.0, y, z), dvec3(0.0, 0.0, z)]);
    b.quad(p.teal_wall, [dvec3(x, 0.0, 0.0), dvec3(x, 0.0, z), dvec3(x, y, z), dvec3(x, y, 0.0)]);
    b.quad(p.white_wall, [dvec3(0.0, 0.0, 0.0), dvec3(0.0, 0.0, z), dvec3(x, 0.0, z), dvec3(x, 0.0, 0.0)]);
    // The back wall leaves the window free.
    let ([wx0, wx1], [wz0, wz1]) = (WINDOW_X, WINDOW_Z);
    for [x0, x1, z0, z1] in [[0.0, wx0, 0.0, z], [wx1, x, 0.0, z], [wx0, wx1, 0.0, wz0], [wx0, wx1, wz1, z]] {
        b.quad(p.white_wall, [dvec3(x0, y, z0), dvec3(x1, y, z0), dvec3(x1, y, z1), dvec3(x0, y, z1)]);
    }
    let (deep, high) = (0.015, 0.08);
    let hidden = skip::Z0 | skip::X0 | skip::X1;
    b.block(p.white_paint, [0.0, y - deep, 0.0], [x, y, high], hidden | skip::Y1);
    b.block(p.white_paint, [0.0, 0.0, 0.0], [DOOR_X[0] - 0.07, deep, high], hidden | skip::Y0);
    b.block(p.white_paint, [DOOR_X[1] + 0.07, 0.0, 0.0], [x, deep, high], hidden | skip::Y0);
    let hidden = skip::Z0 | skip::Y0 | skip::Y1;
    b.block(p.white_paint, [0.0, deep, 0.0], [deep, y - deep, high], hidden | skip::X0);
    b.block(p.white_paint, [x - deep, deep, 0.0], [x, y - deep, high], hidden | skip::X1);
}

/// The sky behind the window, the wall's thickness around it, and the frame.
fn window(b: &mut Builder, p: &Palette) {
    let ([x0, x1], [z0, z1]) = (WINDOW_X, WINDOW_Z);
    let (near, far) = (SIZE.y, SIZE.y + RECESS);
    b.quad(p.sky, [dvec3(x0, far, z0), dvec3(x1, far, z0), dvec3(x1, far, z1), dvec3(x0, far, z1)]);
    b.quad(p.white_wall, [dvec3(x0, near, z0), dvec3(x0, far, z0), dvec3(x0, far, z1), dvec3(x0, near, z1)]);
    b.quad(p.white_wall, [dvec3(x1, near, z0), dvec3(x1, near, z1), dvec3(x1, far, z1), dvec3(x1, far, z0)]);
    b.quad(p.white_paint, [dvec3(x0, near, z0), dvec3(x1, near, z0), dvec3(x1, far, z0), dvec3(x0, far, z0)]);
    b.quad(p.white_wall, [dvec3(x0, near, z1), dvec3(x0, far, z1), dvec3(x1, far, z1), dvec3(x1, near, z1)]);
    // Bars: outer posts and rails, a middle post, two cross bars.
    let (y0, y1, bar) = (near + 0.07, near + 0.13, 0.05);
    let middle = 0.5 * (x0 + x1);
    let ends = skip::Z0 | skip::Z1;
    b.block(p.white_paint, [x0, y0, z0], [x0 + bar, y1, z1], ends | skip::X0);
    b.block(p.white_paint, [x1 - bar, y0, z0], [x1, y1, z1], ends | skip::X1);
    b.block(p.white_paint, [middle - 0.5 * bar, y0, z0], [middle + 0.5 * bar, y1, z1], ends);
    let ends = skip::X0 | skip::X1;
    for [left, right] in [[x0 + bar, middle - 0.5 * bar], [middle + 0.5 * bar, x1 - bar]] {
        b.block(p.white_paint, [left, y0, z0], [right, y1, z0 + bar], ends | skip::Z0);
        b.block(p.white_paint, [left, y0, z1 - bar], [right, y1, z1], ends | skip::Z1);
        b.block(p.white_paint, [left, y0, 1.60], [right, y1, 1.60 + 0.8 * bar], ends);
    }
}

const DOOR_X: [f64; 2] = [4.7, 5.6];

/// A panelled door in the front wall.
fn door(b: &mut Builder, p: &Palette) {
    let [x0, x1] = DOOR_X;
    let (top, leaf, frame) = (2.05, 0.03, 0.05);
    b.quad(p.oak, [dvec3(x0, leaf, 0.0), dvec3(x0, leaf, top), dvec3(x1, leaf, top), dvec3(x1, leaf, 0.0)]);
    for [z0, z1] in [[0.20, 0.90], [1.05, 1.85]] {
        b.block(p.oak, [x0 + 0.14, leaf, z0], [x1 - 0.14, leaf + 0.012, z1], skip::Y0);
    }
    let post = skip::Y0 | skip::Z0 | skip::Z1;
    b.block(p.white_paint, [x0 - 0.07, 0.0, 0.0], [x0, frame, top], post);
    b.block(p.white_paint, [x1, 0.0, 0.0], [x1 + 0.07, frame, top], post);
    b.block(p.white_paint, [x0 - 0.07, 0.0, top], [x1 + 0.07, frame, top + 0.07], skip::Y0);
    let knob = dvec3(x0 + 0.07, leaf, 1.0);
    b.lathe(p.brass, knob, DVec3::Y, &[(0.024, 0.0), (0.024, 0.006), (0.009, 0.006), (0.009, 0.05)]);
    b.sphere(p.brass, knob + DVec3::Y * 0.065, 0.024);
}

/// Table, chairs, pendant lamps, and two shelves on the back wall.
fn dining_corner(b: &mut Builder, p: &Palette) {
    let center = TABLE.extend(0.0);
    let top = TABLE_HEIGHT;
    b.lathe(
        p.walnut,
        center,
        DVec3::Z,
        &[(0.30, 0.0), (0.30, 0.02), (0.07, 0.05), (0.045, top - 0.03), (0.56, top - 0.03), (0.56, top), (0.0, top)],
    );
    let on_table = |radius: f64, angle: f64| center + dvec3(radius * angle.cos(), radius * angle.sin(), top);
    fruit_bowl(b, p, on_table(0.0, 0.0));
    for angle in [-52.0_f64, 25.0, 165.0].map(f64::to_radians) {
        let plate = [(0.07, 0.0), (0.115, 0.014), (0.07, 0.004), (0.0, 0.004)];
        b.lathe(p.porcelain, on_table(0.41, angle), DVec3::Z, &plate);
        let place = center + 0.80 * dvec3(angle.cos(), angle.sin(), 0.0);
        b.frame = DAffine3::from_translation(place) * DAffine3::from_rotation_z(angle + PI);
        chair(b, p);
        b.frame = DAffine3::IDENTITY;
    }
    for side in [-0.26, 0.26] {
        pendant(b, p, (TABLE + dvec2(side, 0.0)).extend(SIZE.z));
    }
    for z in [1.34, 1.76] {
        b.block(p.walnut, [0.55, 4.27, z - 0.03], [2.25, SIZE.y, z], skip::Y1);
    }
    let lower = |x: f64| dvec3(x, 4.38, 1.34);
    books(b, p, dvec3(0.62, 4.30, 1.34), 4, 0);
    b.sphere(p.chrome, lower(1.02) + DVec3::Z * 0.075, 0.075);
    vase(b, p.green_glaze, lower(1.30), 0.20);
    let ring = 0.075;
    b.torus(p.brass, lower(1.62) + DVec3::Z * (ring + 0.02), DVec3::Y, ring, 0.02);
    b.lathe(p.blue_glaze, lower(1.90), DVec3::Z, &[(0.07, 0.0), (0.0, 0.24)]);
    b.sphere(p.porcelain, lower(2.11) + DVec3::Z * 0.05, 0.05);
    let upper = |x: f64| dvec3(x, 4.38, 1.76);
    b.sphere(p.copper, upper(0.72) + DVec3::Z * 0.08, 0.08);
    b.torus(p.chrome, upper(0.98) + DVec3::Z * 0.022, DVec3::Z, 0.07, 0.022);
    vase(b, p.porcelain, upper(1.30), 0.26);
    books(b, p, dvec3(1.58, 4.30, 1.76), 3, 2);
    bowl(b, p.blue_glaze, upper(1.98));
}

/// A chair at the origin that looks along x.
fn chair(b: &mut Builder, p: &Palette) {
    let (paint, seat) = (p.chair_paint, 0.46);
    b.block(paint, [-0.20, -0.21, seat - 0.03], [0.21, 0.21, seat], skip::NONE);
    for y in [-0.175, 0.175] {
        for x in [-0.17, 0.17] {
            b.rod(paint, [dvec3(1.1 * x, 1.1 * y, 0.0), dvec3(x, y, seat - 0.02)], [0.011, 0.018]);
        }
        b.lathe(paint, dvec3(-0.175, y, seat), DVec3::Z, &[(0.014, 0.0), (0.012, 0.44), (0.0, 0.44)]);
    }
    for [z0, z1] in [[0.60, 0.65], [0.78, 0.86]] {
        // Their ends are inside of the posts.
        b.block(paint, [-0.182, -0.175, z0], [-0.168, 0.175, z1], skip::Y0 | skip::Y1);
    }
}

fn fruit_bowl(b: &mut Builder, p: &Palette, base: DVec3) {
    bowl(b, p.brass, base);
    let radius = 0.034;
    b.sphere(p.apple, base + DVec3::Z * (0.014 + radius), radius);
    // Resting on the slope between (0.05, 0.016) and (0.105, 0.054), 0.07 from the middle.
    let slope = dvec2(0.055, 0.038).normalize();
    let height = 0.016 + (radius + (0.07 - 0.05) * slope.y) / slope.x;
    for k in 0..5 {
        let a = TAU * f64::from(k) / 5.0;
        b.sphere(p.apple, base + dvec3(0.07 * a.cos(), 0.07 * a.sin(), height), radius);
    }
}

/// A bowl of 28 cm.
fn bowl(b: &mut Builder, material: u32, base: DVec3) {
    let profile =
        [(0.05, 0.0), (0.11, 0.046), (0.14, 0.092), (0.135, 0.092), (0.105, 0.054), (0.05, 0.016), (0.0, 0.014)];
    // It stands on its foot: the underside is not there.
    b.lathe(material, base, DVec3::Z, &profile);
}

/// A bellied vase, open at the top.
fn vase(b: &mut Builder, material: u32, base: DVec3, height: f64) {
    let profile = [
        (0.22, 0.0),
        (0.34, 0.20),
        (0.36, 0.40),
        (0.26, 0.64),
        (0.13, 0.84),
        (0.20, 1.0),
        (0.18, 1.0),
        (0.11, 0.84),
        (0.0, 0.60),
    ];
    b.lathe(material, base, DVec3::Z, &profile.map(|(r, z)| (r * height, z * height)));
}

/// A row of books along x, standing on `base`.
fn books(b: &mut Builder, p: &Palette, base: DVec3, count: usize, first: usize) {
    let mut x = base.x;
    for k in first..first + count {
        let thick = [0.030, 0.042, 0.024, 0.036, 0.028][k % 5];
        let high = [0.23, 0.20, 0.25, 0.21, 0.18, 0.24][k % 6];
        let deep = [0.16, 0.15, 0.17][k % 3];
        b.block(p.books[k % 4], [x, base.y, base.z], [x + thick, base.y + deep, base.z + high], skip::Z0);
        x += thick + 0.002;
    }
}

/// A conical lampshade, 4 mm thick: opening radius, radius at the other end, height; from the opening's middle along
/// `axis`. `closed`: with a lid at the other end.
fn shade(b: &mut Builder, [outside, inside]: [u32; 2], base: DVec3, axis: DVec3, size: [f64; 3], closed: bool) {
    let [open, back, height] = size;
    let t = 0.004;
    let rim = [(open - t, 0.0), (open, 0.0), (back, height)];
    b.lathe(outside, base, axis, &rim);
    if closed {
        b.lathe(outside, base, axis, &[(back, height), (0.0, height)]);
        b.lathe(inside, base, axis, &[(0.0, height - t), (back - t, height - t), (open - t, 0.0)]);
    } else {
        b.lathe(outside, base, axis, &[(back, height), (back - t, height)]);
        b.lathe(inside, base, axis, &[(back - t, height), (open - t, 0.0)]);
    }
}

/// A lamp that hangs from the ceiling at `top`.
fn pendant(b: &mut Builder, p: &Palette, top: DVec3) {
    let below = |d: f64| top - DVec3::Z * d;
    b.lathe(p.black_metal, below(0.03), DVec3::Z, &[(0.004, 0.0), (0.05, 0.0), (0.05, 0.03)]);
    let (open, lid) = (1.07, 0.86);
    b.rod(p.black_metal, [below(lid), below(0.03)], [0.004, 0.004]);
    shade(b, [p.shade_red, p.shade_white], below(open), DVec3::Z, [0.18, 0.035, open - lid], true);
    let socket = below(lid + 0.004);
    b.lathe(p.black_metal, socket - DVec3::Z * 0.10, DVec3::Z, &[(0.0, 0.0), (0.016, 0.0), (0.016, 0.10)]);
    // The bulb reaches a little below the rim.
    b.sphere(p.bulb, socket - DVec3::Z * (0.10 + 0.042), 0.045);
}

/// Sofa, rug, coffee table, floor lamp, picture and a tall vase along the right wall.
fn sofa_corner(b: &mut Builder, p: &Palette) {
    b.frame = DAffine3::from_translation(dvec3(5.97, 2.1, 0.0)) * DAffine3::from_rotation_z(PI);
    sofa(b, p);
    b.frame = DAffine3::IDENTITY;
    b.block(p.rug, [3.25, 1.15, 0.0], [4.95, 3.05, RUG_HEIGHT], skip::Z0);
    coffee_table(b, p, dvec3(4.12, 2.1, RUG_HEIGHT));
    b.sphere(p.chrome, dvec3(2.86, 1.32, 0.17), 0.17);
    b.sphere(p.copper, dvec3(3.02, 1.68, 0.10), 0.10);
    floor_lamp(b, p, dvec3(5.52, 3.50, 0.0));
    vase(b, p.blue_glaze, dvec3(5.60, 4.10, 0.0), 0.75);
    picture(b, p);
}

/// A sofa at the origin that looks along x.
fn sofa(b: &mut Builder, p: &Palette) {
    for x in [0.08, 0.82] {
        for y in [-0.90, 0.90] {
            b.rod(p.walnut, [dvec3(x, y, 0.0), dvec3(x, y, 0.12)], [0.018, 0.03]);
        }
    }
    b.block(p.sofa, [0.0, -1.0, 0.12], [0.90, 1.0, 0.30], skip::NONE);
    b.block(p.sofa, [0.0, -0.79, 0.30], [0.22, 0.79, 0.84], skip::Z0);
    for side in [-1.0_f64, 1.0] {
        let (inner, outer): (f64, f64) = (0.80 * side, side);
        b.block(p.sofa, [0.0, inner.min(outer), 0.30], [0.90, inner.max(outer), 0.56], skip::Z0 | skip::Z1);
        // The rounded armrest: its lower half is inside of the block.
        let arm = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.92), (0.0, 0.92)];
        b.lathe(p.sofa, dvec3(-0.01, 0.90 * side, 0.56), DVec3::X, &arm);
        let (y0, y1): (f64, f64) = (0.005 * side, 0.785 * side);
        let (low, high) = (y0.min(y1), y0.max(y1));
        b.block(p.cushion, [0.23, low, 0.30], [0.895, high, 0.45], skip::Z0);
        b.block(p.cushion, [0.23, low + 0.01, 0.45], [0.37, high - 0.01, 0.80], skip::Z0);
        let roll = [(0.0, 0.0), (0.085, 0.0), (0.085, 0.44), (0.0, 0.44)];
        b.lathe(p.bolster, dvec3(0.46, 0.5 * side - 0.22, 0.535), DVec3::Y, &roll);
    }
}

fn coffee_table(b: &mut Builder, p: &Palette, base: DVec3) {
    let (radius, rim, top) = (0.42, 0.014, 0.40);
    let middle = base + DVec3::Z * (top - rim);
    // Top and underside are tangent to the rim.
    b.torus(p.walnut, middle, DVec3::Z, radius, rim);
    b.lathe(p.walnut, base, DVec3::Z, &[(radius, top), (0.0, top)]);
    b.lathe(p.walnut, base, DVec3::Z, &[(0.0, top - 2.0 * rim), (radius, top - 2.0 * rim)]);
    for k in 0..3 {
        let a = 0.4 + TAU * f64::from(k) / 3.0;
        let out = dvec3(a.cos(), a.sin(), 0.0);
        b.rod(
            p.brass,
            [base + 0.34 * out - DVec3::Z * (0.3 * RUG_HEIGHT), base + 0.26 * out + DVec3::Z * (top - rim)],
            [0.010, 0.018],
        );
    }
    let on_top = |x: f64, y: f64| base + dvec3(x, y, top);
    vase(b, p.porcelain, on_top(0.14, 0.16), 0.22);
    b.sphere(p.chrome, on_top(-0.16, 0.10) + DVec3::Z * 0.065, 0.065);
    b.sphere(p.copper, on_top(-0.05, -0.01) + DVec3::Z * 0.042, 0.042);
    b.block(p.books[1], (on_top(0.02, -0.30)).to_array(), (on_top(0.26, -0.13) + DVec3::Z * 0.03).to_array(), skip::Z0);
    let book = on_top(0.05, -0.28) + DVec3::Z * 0.03;
    b.block(p.books[2], book.to_array(), (book + dvec3(0.19, 0.13, 0.022)).to_array(), skip::Z0);
}

/// A lamp with a linen shade open at both ends.
fn floor_lamp(b: &mut Builder, p: &Palette, base: DVec3) {
    let at = |z: f64| base + DVec3::Z * z;
    b.lathe(p.black_metal, base, DVec3::Z, &[(0.15, 0.0), (0.15, 0.02), (0.012, 0.03), (0.012, 1.52), (0.018, 1.52)]);
    b.lathe(p.black_metal, at(1.52), DVec3::Z, &[(0.018, 0.0), (0.018, 0.05), (0.0, 0.05)]);
    b.sphere(p.bulb, at(1.57 + 0.046), 0.05);
    let (bottom, height) = (1.47, 0.27);
    shade(b, [p.linen, p.shade_white], at(bottom), DVec3::Z, [0.23, 0.15, height], false);
    // Three spokes carry the shade; they end inside of its thickness.
    let (z, share) = (1.54, (1.54 - bottom) / height);
    let reach = 0.23 + (0.15 - 0.23) * share - 0.002;
    for k in 0..3 {
        let a = TAU * f64::from(k) / 3.0;
        b.rod(p.black_metal, [at(z), at(z) + reach * dvec3(a.cos(), a.sin(), 0.0)], [0.003, 0.003]);
    }
}

/// A framed painting over the sofa.
fn picture(b: &mut Builder, p: &Palette) {
    let (y0, y1, z0, z1) = (1.55, 2.65, 1.30, 2.00);
    let (x, front, bar) = (SIZE.x, SIZE.x - 0.035, 0.035);
    let canvas = SIZE.x - 0.015;
    let (columns, rows) = (4, 3);
    for column in 0..columns {
        for row in 0..rows {
            let share = |k: i32, n: i32, a: f64, b: f64| a + (b - a) * f64::from(k) / f64::from(n);
            let [ya, yb] = [column, column + 1].map(|k| share(k, columns, y0, y1));
            let [za, zb] = [row, row + 1].map(|k| share(k, rows, z0, z1));
            let paint = p.art[[3, 0, 3, 1, 2, 3, 4, 3, 1, 3, 2, 0][(column * rows + row) as usize]];
            b.quad(paint, [dvec3(canvas, yb, za), dvec3(canvas, ya, za), dvec3(canvas, ya, zb), dvec3(canvas, yb, zb)]);
        }
    }
    let wall = skip::X1;
    b.block(p.brass, [front, y0 - bar, z0 - bar], [x, y0, z1 + bar], wall);
    b.block(p.brass, [front, y1, z0 - bar], [x, y1 + bar, z1 + bar], wall);
    b.block(p.brass, [front, y0, z0 - bar], [x, y1, z0], wall | skip::Y0 | skip::Y1);
    b.block(p.brass, [front, y0, z1], [x, y1, z1 + bar], wall | skip::Y0 | skip::Y1);
}

/// A sideboard with a globe lamp, a desk lamp and vases; a brass disk in a ring above it.
fn left_wall(b: &mut Builder, p: &Palette) {
    let (x0, x1, y0, y1, z0, z1) = (0.02, 0.44, 1.05, 2.45, 0.14, 0.72);
    b.block(p.walnut, [x0, y0, z0], [x1, y1, z1], skip::NONE);
    for x in [x0 + 0.05, x1 - 0.05] {
        for y in [y0 + 0.07, y1 - 0.07] {
            b.rod(p.brass, [dvec3(x, y, 0.0), dvec3(x, y, z0)], [0.012, 0.02]);
        }
    }
    let width = (y1 - y0 - 0.04) / 3.0;
    for k in 0..3 {
        let y = y0 + 0.02 + width * f64::from(k);
        let front = x1 + 0.016;
        b.block(p.oak, [x1, y + 0.004, z0 + 0.02], [front, y + width - 0.004, z1 - 0.02], skip::X0);
        b.sphere(p.brass, dvec3(front + 0.012, y + 0.05, 0.5 * (z0 + z1)), 0.014);
    }
    globe_lamp(b, p, dvec3(0.22, 1.28, z1));
    vase(b, p.green_glaze, dvec3(0.20, 1.62, z1), 0.28);
    bowl(b, p.copper, dvec3(0.23, 1.92, z1));
    b.frame = DAffine3::from_translation(dvec3(0.15, 2.26, z1)) * DAffine3::from_rotation_z(-0.5 * PI + 0.35);
    desk_lamp(b, p);
    b.frame = DAffine3::IDENTITY;
    let disk = dvec3(0.022, 1.75, 1.65);
    b.torus(p.black_metal, disk, DVec3::X, 0.28, 0.022);
    b.lathe(p.brass, disk, DVec3::X, &[(0.28, 0.0), (0.0, 0.012)]);
}

fn globe_lamp(b: &mut Builder, p: &Palette, base: DVec3) {
    let foot = [(0.075, 0.0), (0.075, 0.012), (0.014, 0.03), (0.014, 0.10), (0.05, 0.12), (0.05, 0.14), (0.0, 0.14)];
    b.lathe(p.brass, base, DVec3::Z, &foot);
    // The globe sits a little in its cup.
    b.sphere(p.globe, base + DVec3::Z * (0.14 + 0.11 - 0.006), 0.11);
}

/// A lamp with two arms and a tilted head at the origin, reaching along y.
fn desk_lamp(b: &mut Builder, p: &Palette) {
    b.lathe(p.shade_red, DVec3::ZERO, DVec3::Z, &[(0.085, 0.0), (0.085, 0.02), (0.0, 0.02)]);
    let (foot, elbow, wrist) = (dvec3(0.0, 0.0, 0.02), dvec3(0.0, -0.10, 0.30), dvec3(0.0, 0.12, 0.50));
    for (from, to) in [(foot, elbow), (elbow, wrist)] {
        b.rod(p.chrome, [from, to], [0.006, 0.006]);
        b.sphere(p.black_metal, to, 0.013);
    }
    let back = dvec3(0.0, -0.40, 0.92).normalize();
    let height = 0.12;
    let opening = wrist - back * (height + 0.008);
    shade(b, [p.shade_red, p.shade_white], opening, back, [0.08, 0.03, height], true);
    let socket = opening + back * (height - 0.004);
    b.lathe(p.black_metal, socket - back * 0.035, back, &[(0.0, 0.0), (0.012, 0.0), (0.012, 0.035)]);
    b.sphere(p.bulb, socket - back * (0.035 + 0.026), 0.028);
}

/// A low bookcase on the front wall.
fn bookcase(b: &mut Builder, p: &Palette) {
    let (x0, x1, y0, y1, top, t) = (1.5, 3.0, 0.02, 0.32, 0.90, 0.025);
    let ends = skip::Z0 | skip::Z1;
    b.block(p.oak, [x0, y0, 0.0], [x0 + t, y1, top], ends);
    b.block(p.oak, [x1 - t, y0, 0.0], [x1, y1, top], ends);
    b.block(p.oak, [x0, y0, top], [x1, y1 + 0.01, top + t], skip::NONE);
    for z in [0.06, 0.48] {
        b.block(p.oak, [x0 + t, y0, z], [x1 - t, y1 - 0.01, z + t], skip::X0 | skip::X1);
    }
    let back = skip::X0 | skip::X1 | ends;
    b.block(p.oak, [x0 + t, y0, 0.06 + t], [x1 - t, y0 + 0.008, 0.48], back);
    b.block(p.oak, [x0 + t, y0, 0.48 + t], [x1 - t, y0 + 0.008, top], back);
    books(b, p, dvec3(1.58, 0.10, 0.48 + t), 5, 1);
    b.sphere(p.blue_glaze, dvec3(2.10, 0.18, 0.48 + t + 0.09), 0.09);
    vase(b, p.porcelain, dvec3(2.45, 0.18, 0.48 + t), 0.24);
    bowl(b, p.green_glaze, dvec3(1.95, 0.18, 0.06 + t));
    books(b, p, dvec3(2.55, 0.10, 0.06 + t), 3, 3);
    b.lathe(p.copper, dvec3(2.75, 0.17, top + t), DVec3::Z, &[(0.09, 0.0), (0.0, 0.30)]);
    b.torus(p.chrome, dvec3(2.40, 0.17, top + t + 0.03), DVec3::Z, 0.09, 0.03);
}

/// A plant in a clay pot: leaves folded along the middle, each on a stalk of its own.
fn plant(b: &mut Builder, p: &Palette, base: DVec3) {
    let pot = [(0.13, 0.0), (0.17, 0.28), (0.185, 0.28), (0.185, 0.32), (0.165, 0.32), (0.16, 0.29)];
    b.lathe(p.clay, base, DVec3::Z, &pot);
    let soil = base + DVec3::Z * 0.29;
    b.lathe(p.soil, soil, DVec3::Z, &[(0.16, 0.0), (0.0, 0.0)]);
    // Leaves follow each other by the golden angle.
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    for k in 0..10 {
        let t = f64::from(k) / 9.0;
        let a = golden * f64::from(k) + 0.6;
        let out = dvec3(a.cos(), a.sin(), 0.0);
        let side = dvec3(-a.sin(), a.cos(), 0.0);
        let root = soil + 0.05 * out;
        let start = soil + (0.16 - 0.10 * t) * out + DVec3::Z * (0.20 + 0.50 * t);
        b.rod(p.leaf, [root, start], [0.008, 0.004]);
        let middle = start + 0.10 * out + DVec3::Z * (0.08 + 0.06 * t);
        let tip = start + (0.22 - 0.06 * t) * out + DVec3::Z * (0.02 + 0.16 * t);
        for half in [-1.0, 1.0] {
            let edge = middle + half * 0.07 * side + DVec3::Z * 0.025;
            let corners = if half < 0.0 { [start, edge, tip] } else { [start, tip, edge] };
            b.triangle(p.leaf, corners);
        }
    }
}

/// A flat round lamp under the ceiling.
fn ceiling_lamp(b: &mut Builder, p: &Palette, at: DVec2) {
    let base = at.extend(SIZE.z - 0.08);
    b.lathe(p.white_paint, base, DVec3::Z, &[(0.24, 0.0), (0.26, 0.0), (0.26, 0.08)]);
    b.lathe(p.panel, base, DVec3::Z, &[(0.0, 0.008), (0.24, 0.008)]);
    b.lathe(p.white_paint, base, DVec3::Z, &[(0.24, 0.008), (0.24, 0.0)]);
}
