#pragma once

#include <map>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/base/options.h"
#include "core/train/settings/training_settings.h"

namespace pepeseg {

// Passes the options of every stage to `visit`, with names such as "reconstruct.num_steps". The
// preset is not one of them: it sets others.
void VisitOptions(TrainingSettings& settings, OptionVisitor visit);

// Returns INVALID_ARGUMENT, naming the option and its range, unless all options are in range.
absl::Status Validate(const TrainingSettings& settings);

// Returns what each option does, by name: the comment on its member, which describe_options.py
// reads from the header when the program is built.
const std::map<absl::string_view, absl::string_view>& OptionDescriptions();

}  // namespace pepeseg
