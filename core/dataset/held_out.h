#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/dataset/import.h"

// Which views of a dataset are held out of training (METHOD.md section 0).
namespace pepeseg {

// Returns INVALID_ARGUMENT if one of options.held_out_views is not in `photographs`, or if all of
// them are held out. The message names up to three photographs with a similar name. `photographs`
// are names of views, as PhotoKey returns them.
absl::Status CheckHeldOutViews(const ImportOptions& options,
                               std::span<const std::string> photographs);

// Returns true if the view is held out. `index` is its position among all views by name.
bool IsHeldOut(const ImportOptions& options, absl::string_view view, size_t index);

// Returns the number of views that are held out of `num_views`. A name that is given twice counts
// once.
int64_t NumHeldOut(const ImportOptions& options, int64_t num_views);

}  // namespace pepeseg
