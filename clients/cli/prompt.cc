#include "clients/cli/prompt.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cli/pixel_frame.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

// "120,88.5".
absl::StatusOr<v1::PointsPrompt::Point> ParsePoint(const std::string& text, bool negative) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  v1::PointsPrompt::Point point;
  double x = 0;
  double y = 0;
  if (parts.size() != 2 || !absl::SimpleAtod(parts[0], &x) || !absl::SimpleAtod(parts[1], &y)) {
    return absl::InvalidArgumentError(
        absl::StrCat("point \"", text, "\": x,y in pixels is wanted, as 320,240"));
  }
  point.set_x(x);
  point.set_y(y);
  point.set_negative(negative);
  return point;
}

// "10,20,100,80".
absl::StatusOr<v1::BoxPrompt> ParseBox(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  double numbers[4] = {};
  bool good = parts.size() == 4;
  for (size_t i = 0; good && i < 4; ++i) good = absl::SimpleAtod(parts[i], &numbers[i]);
  if (!good) {
    return absl::InvalidArgumentError(absl::StrCat(
        "box \"", text, "\": x,y,width,height in pixels is wanted, as 100,80,240,160"));
  }
  v1::BoxPrompt box;
  box.set_x(numbers[0]), box.set_y(numbers[1]);
  box.set_width(numbers[2]), box.set_height(numbers[3]);
  return box;
}

// Into the verb itself, or into a group of its options.
CLI::Option* AddPoints(CLI::App& verb, PromptFlags& flags) {
  CLI::Option* point =
      verb.add_option("-p,--point", flags.positive, "A pixel of what is meant; may be repeated")
          ->type_name("X,Y")
          ->allow_extra_args(false);
  return point;
}

void AddNegative(CLI::App& verb, PromptFlags& flags, CLI::Option* point) {
  verb.add_option("-n,--negative", flags.negative, "A pixel of what is not meant")
      ->type_name("X,Y")
      ->allow_extra_args(false)
      ->needs(point);
}

}  // namespace

void AddPromptFlags(CLI::App& verb, PromptFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--view", flags.view, "The view that is clicked in")->required();
  AddNegative(verb, flags, AddPoints(verb, flags)->required());
  verb.add_option("--model", flags.model, "Number of the model")->capture_default_str();
  AddFrameFlag(verb, flags.frame);
}

void AddAnyPromptFlags(CLI::App& verb, PromptFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  CLI::Option* view = verb.add_option("--view", flags.view, "The view that is pointed at");
  CLI::Option_group* what = verb.add_option_group("prompt", "What is meant, one of");
  CLI::Option* point = AddPoints(*what, flags)->needs(view);
  what->add_option("--box", flags.box, "A box around what is meant")
      ->type_name("X,Y,WIDTH,HEIGHT")
      ->needs(view);
  what->add_option("--mask", flags.mask, "A grey PNG of the frame's size, 0 outside")->needs(view);
  what->add_option("--label", flags.label, "What was given this label; it has its own view")
      ->excludes(view);
  what->require_option(1);
  AddNegative(verb, flags, point);
  verb.add_option("--model", flags.model, "Number of the model")->capture_default_str();
  AddFrameFlag(verb, flags.frame);
}

void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags) {
  CLI::Option* scale =
      verb.add_option("--scale", flags.scale, "How large a thing: 0 a small part, 1 the largest")
          ->check(CLI::Range(0.0, 1.0));
  verb.add_option("--scale-units", flags.units, "The same as a length in the scene's unit")
      ->check(CLI::PositiveNumber)
      ->excludes(scale);
  verb.add_option("--threshold", flags.threshold, "Cosine over which a pixel is in")
      ->check(CLI::Range(-1.0, 1.0));
}

v1::Granularity ToGranularity(const GranularityFlags& flags) {
  v1::Granularity granularity;
  if (flags.scale >= 0) granularity.set_scale_quantile(flags.scale);
  if (flags.units > 0) granularity.set_scale_units(flags.units);
  if (flags.threshold >= -1) granularity.set_threshold(flags.threshold);
  return granularity;
}

absl::StatusOr<v1::PointsPrompt> ParsePoints(const PromptFlags& flags) {
  v1::PointsPrompt prompt;
  for (const std::string& text : flags.positive) {
    ASSIGN_OR_RETURN(*prompt.add_points(), ParsePoint(text, false));
  }
  for (const std::string& text : flags.negative) {
    ASSIGN_OR_RETURN(*prompt.add_points(), ParsePoint(text, true));
  }
  return prompt;
}

absl::StatusOr<v1::Prompt> ParsePrompt(const PromptFlags& flags) {
  v1::Prompt prompt;
  if (!flags.label.empty()) {
    prompt.set_label(flags.label);
    return prompt;
  }
  prompt.mutable_view()->set_view(flags.view);
  if (!flags.box.empty()) {
    ASSIGN_OR_RETURN(*prompt.mutable_box(), ParseBox(flags.box));
  } else if (!flags.mask.empty()) {
    ASSIGN_OR_RETURN(*prompt.mutable_mask()->mutable_png(), ReadFile(flags.mask));
  } else {
    ASSIGN_OR_RETURN(*prompt.mutable_points(), ParsePoints(flags));
  }
  return prompt;
}

}  // namespace pepeseg::client::cli
