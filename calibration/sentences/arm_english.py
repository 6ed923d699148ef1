"""English sentences on the errors of an arm as built (documents identified_arm, calibration_in_use)."""

ARM = {
    "arm-errors": "the arm is not as drawn: with its own errors views left out by region of the joints are missed by"
    " {after_mm:.2g} mm instead of {before_mm:.2g} mm",
    "arm-as-drawn": "these views show no errors of the arm",
    "arm-other-load": "the arm's errors were identified with {before_kg:g} kg on the flange, which"
    " carries {now_kg:g} kg: the sag is computed for that by what is known of the arm's compliance",
    "arm-temperature-unknown": "the arm's errors were identified at {before_c:.1f} °C, and its temperature is not known"
    " now: it is taken for the same, uncertain by {sigma_k:g} K",
    "arm-joints-from-poses": "the joints of {views} views were computed from their poses",
    "arm-not-identified": "the arm's own errors are not identified: {why}",
    "distance-disagrees": "a distance of {known_mm:.3f} ± {known_sigma_mm:.2g} mm between places of the target is found"
    " as {found_mm:.3f} ± {found_sigma_mm:.2g} mm, {percent:.3f} %: points are registered at that scale",
    "check-distance": "measure the distance and the target's pitch again; if both are right, state the distance as"
    " exactly as it is known, or take views of more places",
    "identify-arm-again": "calibrate again, with the arm's errors and this load, or correct [robot.load]",
    "state-arm-temperature": "state it: POST /arm/temperature, which holds for [robot] temperature_minutes, or"
    " register --arm-temperature",
}
