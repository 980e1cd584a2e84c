#pragma once

#include <optional>

#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"
#include "pepeseg/v1/selection.pb.h"
#include "server/rpc/service_context.h"
#include "server/services/model_lookup.h"

// A selection's row and file.
namespace pepeseg {

v1::Selection ToProto(const SelectionRow& row);

// The request_id, and a digest of what is asked for with it: all other fields as they are.
void SetRequest(v1::SelectRequest request, SelectionRow* row);
void SetRequest(v1::CombineSelectionsRequest request, SelectionRow* row);

// What an earlier call with the row's request_id in its scene made; ALREADY_EXISTS when it asked
// for something else.
absl::StatusOr<std::optional<SelectionRow>> FindEarlier(const ServiceContext& context,
                                                        const SelectionRow& row);

// Writes the file, then the row, of a set of Gaussians of the model. Reads scene, base, request_id
// and request_digest.
absl::StatusOr<SelectionRow> RecordSelection(const ServiceContext& context,
                                             const ResidentModel& model, const GaussianSet& set,
                                             SelectionRow row);

}  // namespace pepeseg
