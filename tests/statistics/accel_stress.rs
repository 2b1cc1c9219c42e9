//! A quick run of the BVH stress tests: see `tools/stress`.

#[path = "../../tools/stress/src/cases/mod.rs"]
mod cases;

#[test]
fn all_cases_pass() {
    for case in cases::CASES {
        for row in case(0.004) {
            let cases::Row { what, tried, wrong, worst } = row;
            assert!(tried > 0, "{what}: nothing was tried");
            assert_eq!(wrong, 0, "{what}: of {tried}; worst: {worst}");
        }
    }
}
