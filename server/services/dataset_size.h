#pragma once

#include <cstdint>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/train/estimate.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

struct WantedTraining;

// OK while the caller still waits for the answer; else CANCELLED or DEADLINE_EXCEEDED.
using CheckWanted = absl::FunctionRef<absl::Status()>;

// Measures a dataset by what the store keeps of its files' headers. Videos count as the frames that
// are taken from them, at a usual size. Headers that are not kept yet are read, at most 48 of
// photographs and 48 of point files (ReadFileHeader bounds each), and `wanted` is asked before each
// of them; the photographs beyond these are supposed to be as large on average. INVALID_ARGUMENT
// names a photograph whose header was refused.
absl::StatusOr<DatasetSize> MeasureDataset(const ServiceContext& context,
                                           const WantedTraining& training, CheckWanted wanted);

}  // namespace pepeseg
