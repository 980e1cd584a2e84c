#include "server/rpc/selection_lookup.h"

#include "server/rpc/error.h"

namespace pepeseg {

absl::StatusOr<GaussianSet> FindSelection(const ServiceContext& /*context*/,
                                          const std::string& name, const std::string& /*model*/,
                                          const std::string& field) {
  return BadField(field, name, "no selection");
}

}  // namespace pepeseg
