#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "pepeseg/v1/training_options.pb.h"

namespace pepeseg::client {

// Adds a setting NAME=VALUE, such as "reconstruct.num_steps=3000", to the options of a training.
// The server, which lists the options (JobService.ListTrainingOptions), reads name and value. Two
// are read here: "preset=best", and "import.held_out_views=a.jpg", which adds a name to the list.
// INVALID_ARGUMENT: there is no "=", or no preset has the name.
absl::Status SetOption(absl::string_view setting, v1::TrainingOptions& options);

}  // namespace pepeseg::client
