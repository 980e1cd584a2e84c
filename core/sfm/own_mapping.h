#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/front/compare_photographs.h"
#include "core/sfm/incremental_mapping.h"
#include "core/sfm/sfm_photographs.h"

namespace pepeseg {

struct OwnMappingInput {
  std::span<const SfmPhotograph> photographs;  // those of `compared`, in the same order
  const ComparedDatabase& compared;
  std::filesystem::path folder;  // gets the model
  int num_threads = 0;           // 0: one for each core. The model does not depend on it
};

struct OwnMapping {
  MappedModels mapped;  // one model, if it is not refused
  // Why the model must not be used, as in "the mapper refused its model: photographs from one
  // spot". Empty: it may be.
  std::string refusal;
};

// Maps photographs by MapGlobally and writes the model as COLMAP does. Refuses a model that fails a
// gate of the mapper or is not plausible (ModelAgreement). `progress` gets the share of the work
// that is done; its error ends the mapping and is returned. Other errors: INTERNAL if pairs and
// features do not fit together; those of ColourPoints, WriteColmapModel and MeasureAgreement.
absl::StatusOr<OwnMapping> MapByOwnMapper(const OwnMappingInput& input,
                                          absl::FunctionRef<absl::Status(double share)> progress);

}  // namespace pepeseg
