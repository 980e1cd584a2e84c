#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"
#include "server/api/resource_name.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

// The row of a selection named in a request. INVALID_ARGUMENT names `field` when it is no name;
// NOT_FOUND. Blocks.
absl::StatusOr<SelectionRow> FindSelectionRow(const ServiceContext& context,
                                              const std::string& name, const std::string& field);

// The Gaussians of a selection named in a request, of this model. INVALID_ARGUMENT
// names `field` when it is no name; NOT_FOUND; FAILED_PRECONDITION when it is of another model;
// DATA_LOSS. Blocks.
absl::StatusOr<GaussianSet> FindSelection(const ServiceContext& context, const std::string& name,
                                          const SceneChild& model, const std::string& field);

}  // namespace pepeseg
