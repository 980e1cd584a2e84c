#pragma once

#include <span>

#include "absl/status/status.h"
#include "core/sfm/mapper/global_model.h"

namespace pepeseg {

// Returns INVALID_ARGUMENT if an index of the photographs or pairs is out of range, or photographs
// of one camera group differ in size.
absl::Status CheckMapperArguments(std::span<const MapperPhotograph> photographs,
                                  std::span<const VerifiedPair> pairs);

}  // namespace pepeseg
