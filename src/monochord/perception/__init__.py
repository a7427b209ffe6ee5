"""Estimates from windows of sound: features, heads, closed forms, models and their training.

An estimator reads windows of a string's two microphones one by one, usually 0.1 s long, and gives for each
one whether something touches the string, where, how hard, and whether it slides: an `Estimate` with a
standard error, or an abstention with a `Reason`. A wrong answer that looks sure is worse than none.

Conventions: audio is (channels, frames) float32 with full scale 1, channel 1 at pickup 1. Values are in SI
units. Positions are in m from pickup 1; features and the reader use shares of the length. Contact and slip
are probabilities. Transforms and powers are (channels, bins), a transform without a taper and a power under
Hann's. Partial n of a string lies at n f0 sqrt(1 + B n^2), with the inharmonicity B. The state of a stream is
passed in and out; a window that starts no later than its predecessor begins another stream.

- `usable` tells why a window cannot be read; `spectrum` analyses one, with the lines of `monochord.dsp.hann`.
- `tuning` measures pitch, stiffness and losses of the untouched string, and follows its pitch.
- `closed_form` locates a touch by physics alone, from the far segment or from both.
- `reader` is the network that gives the density of the position, with its memory; `features` turn windows
  into rows, `heads` are the quantities learned from them, and `model` is what was trained.
- `estimators` are what the live loop and the evaluation run, and `watching` what they tell of the string's
  pitch.
- `training` trains a model and adapts it to known touches; `data` has a dataset's arrays for other libraries.

Features, heads and estimators are plug-ins, one file each, found by name.
"""

MOVED = {"ast": "monochord-encoders", "log_mel": "monochord-encoders", "yamnet": "monochord-yamnet"}
"""Features that another package of the repository has, with its name."""
