use super::*;

fn read(body: &str) -> Result<FlatScene, SvgError> {
    parse_svg(&format!("<svg xmlns=\"http://www.w3.org/2000/svg\">\n{body}\n</svg>"))
}

fn walls(body: &str) -> Vec<(String, [f64; 4])> {
    let scene = read(body).unwrap();
    let ends = |s: &Segment| [s.start.x, s.start.y, s.end.x, s.end.y];
    // Without minus zeros.
    scene.walls().iter().map(|w| (w.name.clone(), ends(&w.local).map(|x| x + 0.0))).collect()
}

#[test]
fn every_shape_is_read() {
    let wall = |name: &str, ends: [f64; 4]| (name.to_owned(), ends);
    assert_eq!(walls("<line id='a' x1='1' y1='2' x2='3'/>"), [wall("a", [1., -2., 3., 0.])]);
    assert_eq!(
        walls("<polyline points='0,0 1,0 1,1'/>"),
        [wall("polyline1.1", [0., 0., 1., 0.]), wall("polyline1.2", [1., 0., 1., -1.])]
    );
    let square = [
        wall("r.1", [0., 0., 2., 0.]),
        wall("r.2", [2., 0., 2., -1.]),
        wall("r.3", [2., -1., 0., -1.]),
        wall("r.4", [0., -1., 0., 0.]),
    ];
    for same in [
        "<rect id='r' width='2' height='1'/>",
        "<polygon id='r' points='0 0 2 0 2 1 0 1'/>",
        "<path id='r' d='M0 0H2V1H0Z'/>",
        "<path id='r' d='m0,0h2v1h-2z'/>",
        "<path id='r' d='M0,0 2,0 L2 1 0 1z'/>",
        "<path id='r' d='m0 0l2 0 0 1-2 0 0-1z'/>",
        "<rect id='r' x='-1' width='2' height='1' transform='translate(1)'/>",
        "<g><rect id='r' width='.2e1' height='1'/></g>",
        "<rect id='r' data-front='outside' width='2' height='1'/>",
    ] {
        assert_eq!(walls(same), square, "{same}");
    }
    // The other way round.
    let inside = walls("<g data-front='inside'><rect id='r' width='2' height='1'/></g>");
    assert_eq!(inside[0], wall("r.1", [0., -1., 2., -1.]));
    assert_eq!(walls("<path d='M0 0L1 0M5 5L6 5z l0 1'/>").len(), 4);
}

#[test]
fn units_transforms_and_materials_are_handed_down() {
    let text = "<svg data-units-per-metre='100'>\
        <g id='room' data-reflectance='0.7' transform='translate(100 0) rotate(90)'>\
        <line id='a' x2='50' data-emit='1,2,3'/><line id='b' x2='50' data-two-sided='true' \
        data-reflectance='0.1'/></g><g display='none'><circle r='1'/></g>\
        <g style='fill:red; display: none'><circle r='1'/></g><title>t</title></svg>";
    let scene = parse_svg(text).unwrap();
    let [a, b] = scene.walls() else { panic!() };
    assert!((a.local.start - DVec2::new(1.0, 0.0)).length() < 1e-15);
    assert!((a.local.end - DVec2::new(1.0, -0.5)).length() < 1e-15, "{a:?}");
    assert_eq!((a.material.reflectance, a.material.exitance), ([0.7; 3], [1.0, 2.0, 3.0]));
    assert_eq!((b.material.reflectance, b.material.two_sided), ([0.1; 3], true));
    assert_eq!(scene.bodies()[0].name, "room");
}

#[test]
fn what_is_in_no_group_rests() {
    let moves = "<animateTransform type='translate' values='0 0;1 0' dur='1'/>";
    let scene = read(&format!("<g id='scene'>{moves}<line x2='1'/></g><line x2='2'/>")).unwrap();
    let [one, two] = scene.bodies() else { panic!() };
    assert_eq!((one.motion.keys().len(), two.motion.keys().len()), (2, 0));
    assert_eq!((one.walls.len(), two.walls.len()), (1, 1));
}

/// Where the end of the first wall of a body is, in SVG's coordinates.
fn end_at(scene: &FlatScene, body: &str, time_s: f64) -> [f64; 2] {
    let body = scene.bodies().iter().find(|b| b.name == body).unwrap();
    let p = body.motion.pose(time_s).point(scene.walls()[body.walls.start as usize].local.end);
    [p.x, -p.y].map(|x| (1e9 * x).round() / 1e9 + 0.0)
}

#[test]
fn groups_slide_and_turn_as_a_browser_shows_them() {
    let slide = "<animateTransform attributeName='transform' type='translate' \
        values='0 0; 4 0; 4 2' keyTimes='0;.5;1' dur='4s' begin='1s'/>";
    let turn = "<animateTransform attributeName='transform' type='rotate' additive='sum' \
        from='0 1 0' to='90 1 0' dur='2'/>";
    let line = "<line x1='1' x2='2'/>";
    let scene = read(&format!("<line x2='9'/><g id='b'>{slide}{line}</g>")).unwrap();
    let at = |scene: &FlatScene, t| end_at(scene, "b", t);
    assert_eq!(at(&scene, 0.5), [2., 0.]);
    assert_eq!(at(&scene, 2.0), [4., 0.]);
    assert_eq!(at(&scene, 4.0), [6., 1.]);
    assert_eq!(at(&scene, 9.0), [6., 2.]);
    // Clockwise about the line's start: its end goes down.
    let scene = read(&format!("<g id='b'>{turn}{line}</g>")).unwrap();
    assert_eq!((at(&scene, 0.0), at(&scene, 2.0)), ([2., 0.], [1., 1.]));
    let scene = read(&format!("<g id='b'>{slide}{turn}{line}</g>")).unwrap();
    assert_eq!(at(&scene, 3.0), [5., 1.]);
    let scene = read(&format!(
        "<g transform='scale(2)'><g id='b' transform='translate(1 1)'>{turn}{line}</g></g>"
    ))
    .unwrap();
    assert_eq!((at(&scene, 0.0), at(&scene, 2.0)), ([6., 2.], [4., 4.]));
    // Half the angle at half the time, not half the way.
    let half = 2.0 * (2.0 + 0.5_f64.sqrt());
    assert_eq!(at(&scene, 1.0)[0], (1e9 * half).round() / 1e9);
}

// Over 60 lines: one table of errors.
#[test]
fn errors_name_the_element_its_line_and_what_helps() {
    let moves = "<animateTransform type='translate' values='0 0;1 0' dur='1'/>";
    for (body, element, what, remedy) in [
        ("<circle id='c' r='2'/>", "circle `c`, line 2", "no straight parts", "polygon"),
        ("<line x1='1px'/>", "line, line 2", "x1 is `1px`", "without a unit"),
        ("\n<line id='p'/>", "line `p`, line 3", "no length", "mend"),
        ("<path d='M0 0C1 1 2 2 3 3'/>", "path", "`C` is no straight line", "flatten"),
        ("<path d='L1 1'/>", "path", "does not begin with M", "M x y"),
        ("<path d='M1'/>", "path", "`M` has too few", "x y"),
        ("<path d='M1 1'/>", "path", "fewer than two points", "leave it out"),
        ("<polygon points='1 2 3'/>", "polygon", "3 numbers", "x y"),
        ("<polygon points='1 2 3 ?'/>", "polygon", "`?` is not a number", "1.5"),
        ("<rect width='1' height='1' rx='.1'/>", "rect", "round", "rx"),
        ("<rect width='1'/>", "rect", "no height", "line"),
        ("<use href='#a'/>", "use", "not read", "leave it out"),
        ("<line x2='1' data-reflectance='1'/>", "line", "[0, 1)", "mend"),
        ("<line x2='1' data-emit='bright'/>", "line", "`bright`", "0.5"),
        ("<line x2='1' data-two-sided='yes'/>", "line", "`yes`", "true"),
        ("<line x2='1' data-front='inside'/>", "line", "closed shapes", "on the left"),
        ("<line x2='1' transform='turn(3)'/>", "line", "turn with 1 numbers", "rotate"),
        ("<line x2='1' transform='scale(0)'/>", "line", "leaves nothing", "other than 0"),
        (&format!("<line x2='1'>{moves}</line>"), "line", "only groups", "<g>"),
        (
            &format!("<g id='a'>{moves}<g id='b'>{moves}</g></g>"),
            "g `b`",
            "within something",
            "of its own",
        ),
        (
            &format!("<g transform='scale(1 2)'><g>{moves}</g></g>"),
            "g",
            "changes its shape",
            "alike",
        ),
        (&format!("<g transform='scale(2)'>{moves}</g>"), "g", "takes the place", "additive"),
        ("<g><animateTransform type='scale' values='1;2' dur='1'/></g>", "g", "`scale`", "rigid"),
        (
            "<g><animateTransform type='rotate' values='0 0 0;9 1 0' dur='1'/></g>",
            "g",
            "about moves",
            "one point",
        ),
        ("<g><animateTransform values='0 0;1 0'/></g>", "g", "no dur", "2s"),
        ("<g><animateTransform values='0 0;1 0' dur='1' begin='click'/></g>", "g", "`click`", "2s"),
        (
            "<g><animateTransform values='0 0;1 0' dur='1' keyTimes='0'/></g>",
            "g",
            "keyTimes",
            "ascending",
        ),
        ("<g><animateTransform dur='1'/></g>", "g", "no values", "from and to"),
        (
            "<line x2='1'><animate attributeName='x1' values='0;1' dur='1'/></line>",
            "line",
            "<animate>",
            "animateTransform",
        ),
        ("<g style='transform: rotate(9deg)'/>", "g", "style", "attribute"),
        (
            "<g><animateTransform values='0 0;1 0' dur='1' calcMode='spline'/></g>",
            "g",
            "`spline`",
            "straight",
        ),
        (
            "<g><animateMotion path='M0 0L1 1' dur='1'/></g>",
            "animateMotion",
            "not read",
            "animateTransform",
        ),
        ("<text>only this</text>", "svg, line 1", "no segments", "draw a line"),
    ] {
        let error = read(body).unwrap_err();
        assert!(error.element.starts_with(element), "{body}: {error}");
        assert!(error.what.contains(what) && error.remedy.contains(remedy), "{body}: {error}");
    }
    assert!(parse_svg("<svg><g></svg>").unwrap_err().what.contains("no XML"));
    assert!(parse_svg("<html/>").unwrap_err().what.contains("no SVG"));
    assert!(parse_svg("segment floor 0 0 1 0").is_err());
    let per_metre = parse_svg("<svg data-units-per-metre='0'><line x2='1'/></svg>").unwrap_err();
    assert!(per_metre.what.contains("`0`"), "{per_metre}");
}

#[test]
fn groups_within_groups_without_end_are_refused() {
    let nested = |depth: usize| {
        let line = r#"<line x1="0" y1="0" x2="1" y2="0"/>"#;
        read(&format!("{}{line}{}", "<g>".repeat(depth), "</g>".repeat(depth)))
    };
    assert!(nested(100).is_ok());
    for depth in [300, 5_000] {
        let error = nested(depth).unwrap_err();
        assert!(error.to_string().contains("groups"), "{error}");
    }
}
