#include "clients/cli/request_flags.h"

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"

namespace pepeseg::client::cli {
namespace {

// Adds --point to a verb, or to a group of its options.
CLI::Option* AddPoints(CLI::App& verb, PromptFlags& flags) {
  CLI::Option* point =
      verb.add_option("-p,--point", flags.positive, "A pixel of the object; may be repeated")
          ->type_name("X,Y")
          ->allow_extra_args(false);
  return point;
}

// Adds --negative, which needs `point`.
void AddNegative(CLI::App& verb, PromptFlags& flags, CLI::Option* point) {
  verb.add_option("-n,--negative", flags.negative,
                  "A pixel that is not of the object; may be repeated")
      ->type_name("X,Y")
      ->allow_extra_args(false)
      ->needs(point);
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

}  // namespace

void AddPromptFlags(CLI::App& verb, PromptFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--view", flags.view, "Name of the view that the pixels are in")->required();
  AddNegative(verb, flags, AddPoints(verb, flags)->required());
  verb.add_option("--model", flags.model, "Number of the model")->capture_default_str();
  AddFrameFlag(verb, flags.frame);
}

void AddAnyPromptFlags(CLI::App& verb, PromptFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  CLI::Option* view =
      verb.add_option("--view", flags.view, "Name of the view that the prompt is in");
  // The group holds the flags of which exactly one kind must be given; --negative only adds to
  // --point.
  CLI::Option_group* what = verb.add_option_group("prompt", "The prompt");
  CLI::Option* point = AddPoints(*what, flags)->needs(view);
  what->add_option("--box", flags.box, "A box around the object")
      ->type_name("X,Y,WIDTH,HEIGHT")
      ->needs(view);
  what->add_option("--mask", flags.mask, "A grey PNG of the frame's size: 0 outside the object")
      ->needs(view);
  what->add_option("--label", flags.label, "A label of the scene: its mask and view")
      ->excludes(view);
  what->require_option(1);
  AddNegative(verb, flags, point);
  verb.add_option("--model", flags.model, "Number of the model")->capture_default_str();
  AddFrameFlag(verb, flags.frame);
}

void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags) {
  CLI::Option* scale =
      verb.add_option("--scale", flags.scale, "Size of the object: 0 a small part, 1 the largest")
          ->check(CLI::Range(0.0, 1.0));
  verb.add_option("--scale-units", flags.units, "Instead of --scale: size in scene units")
      ->check(CLI::PositiveNumber)
      ->excludes(scale);
  verb.add_option("--threshold", flags.threshold,
                  "A pixel is in the mask if its similarity (cosine) is above this")
      ->check(CLI::Range(-1.0, 1.0));
}

v1::Granularity ToGranularity(const GranularityFlags& flags) {
  v1::Granularity granularity;
  if (flags.scale >= 0) granularity.set_scale_quantile(flags.scale);
  if (flags.units > 0) granularity.set_scale_units(flags.units);
  if (flags.threshold >= -1) granularity.set_threshold(flags.threshold);
  return granularity;
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

void AddScalesFlag(CLI::App& verb, std::vector<double>& scales) {
  verb.add_option(
          "--scales", scales,
          "Scales of the levels: quantiles, ascending, separated by commas; by default 0.01,0.5,1")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(0.0, 1.0));
}

void AddSubsetFlags(CLI::App& verb, SubsetFlags& flags) {
  CLI::Option* selection = verb.add_option("--selection", flags.selection,
                                           "Only the Gaussians of this selection, by number")
                               ->check(CLI::PositiveNumber);
  verb.add_option("--segment", flags.segment,
                  "Only the Gaussians of this segment: LEVEL:ID as `pepeseg decompose` prints it")
      ->excludes(selection);
  AddScalesFlag(verb, flags.scales);
  verb.add_flag("--without", flags.without, "All Gaussians except those");
}

absl::StatusOr<v1::Subset> ParseSubset(const SubsetFlags& flags, const std::string& scene) {
  v1::Subset subset;
  subset.set_complement(flags.without);
  if (flags.selection != 0) {
    subset.set_selection(absl::StrCat(SceneName(scene), "/selections/", flags.selection));
  } else if (!flags.segment.empty()) {
    const std::vector<std::string> parts = absl::StrSplit(flags.segment, ':');
    int level = 0, id = 0;
    if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &level) ||
        !absl::SimpleAtoi(parts[1], &id) || level < 0 || id < 1) {
      return absl::InvalidArgumentError(
          absl::StrCat("--segment ", flags.segment, ": expected LEVEL:ID, such as 1:3"));
    }
    subset.mutable_segment()->set_level(level);
    subset.mutable_segment()->set_id(id);
    subset.mutable_segment()->mutable_scales()->Add(flags.scales.begin(), flags.scales.end());
  } else if (flags.without) {
    return absl::InvalidArgumentError("--without needs --selection or --segment");
  }
  return subset;
}

}  // namespace pepeseg::client::cli
