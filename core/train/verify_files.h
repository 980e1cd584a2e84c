#pragma once

#include "absl/status/status.h"
#include "core/train/training_inputs.h"
#include "core/train/training_observer.h"

namespace pepeseg {

// Compares the SHA-256 of each input file with the declared one, before anything is decoded: what a
// disk has changed since the upload is never trained on. Reads each distinct file once, on
// `tools.num_threads` threads. Does nothing where no digests were declared.
//
// DATA_LOSS names the first file whose stored bytes are damaged or gone, as its owner calls it, and
// says how many there are; each of their digests is reported to the observer once. INTERNAL names a
// file that cannot be read: nothing is known of its bytes then.
absl::Status VerifyFiles(const TrainingInputs& inputs, TrainingObserver& observer);

}  // namespace pepeseg
