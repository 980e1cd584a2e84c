#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/evaluate/truth_view.h"
#include "core/query/segmenter.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Runs the protocols of the field's benchmarks on one level of the truth and prints a comment for
// each: mean IoU, pixel accuracy and boundary IoU of each choice of scale, and the time taken.
// `name` begins each line.
absl::Status PrintProtocols(const Segmenter& segmenter, const std::vector<TruthView>& views,
                            const std::string& name);

// Runs the agreement with SAM on the masks of the held-out views, whose own scores are not known,
// and prints a comment. Prints nothing if no held-out view has masks.
absl::Status PrintMaskAgreement(const Segmenter& segmenter, const Capture& capture);

}  // namespace pepeseg
