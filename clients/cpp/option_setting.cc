#include "clients/cpp/option_setting.h"

#include <string>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client {
namespace {

absl::Status SetPreset(absl::string_view name, v1::TrainingOptions& options) {
  v1::TrainingPreset preset;
  if (!v1::TrainingPreset_Parse(absl::StrCat("TRAINING_PRESET_", absl::AsciiStrToUpper(name)),
                                &preset)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--option preset: \"", name, "\" is not one of preview, standard, best, paper"));
  }
  options.set_preset(preset);
  return absl::OkStatus();
}

}  // namespace

absl::Status SetOption(absl::string_view setting, v1::TrainingOptions& options) {
  const size_t equals = setting.find('=');
  if (equals == absl::string_view::npos) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--option ", setting, ": expected NAME=VALUE, such as reconstruct.num_steps=3000"));
  }
  const absl::string_view name = setting.substr(0, equals);
  const std::string value(setting.substr(equals + 1));
  if (name == "preset") return SetPreset(value, options);
  if (name == "import.held_out_views") {
    options.mutable_import()->add_held_out_views(value);
  } else {
    (*options.mutable_advanced())[std::string(name)] = value;
  }
  return absl::OkStatus();
}

}  // namespace pepeseg::client
