#include "clients/cli/request_flags.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"

namespace pepeseg::client::cli {
namespace {

// Adds a flag that adds a part of this kind to the prompt, and may be repeated.
CLI::Option* AddPart(CLI::App& verb, PromptFlags& flags, const std::string& names,
                     const std::string& kind, const std::string& form, const std::string& help) {
  const auto add = [&flags, kind](const std::vector<std::string>& values) {
    for (const std::string& value : values) flags.parts.emplace_back(kind, value);
  };
  return verb.add_option_function<std::vector<std::string>>(names, add, help)
      ->type_name(form)
      ->allow_extra_args(false);
}

CLI::Option* AddPoint(CLI::App& verb, PromptFlags& flags) {
  return AddPart(verb, flags, "-p,--point", "point", "X,Y",
                 "A pixel of the object; may be repeated");
}

void AddNegative(CLI::App& verb, PromptFlags& flags, CLI::Option* point) {
  AddPart(verb, flags, "-n,--negative", "negative", "X,Y",
          "A pixel that is not of the object; may be repeated")
      ->needs(point);
  AddPart(
      verb, flags, "--previous-mask", "previous-mask", "FILE",
      "A grey PNG of the frame's size, which only the last point (--negative comes last) corrects")
      ->needs(point)
      ->expected(1);
}

CLI::Option* AddSceneAndView(CLI::App& verb, PromptFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--model", flags.model,
                  "Number of the model; a job in training, such as jobs/j3, for segment, propose, "
                  "decompose, render")
      ->capture_default_str();
  AddFrameFlag(verb, flags.frame);
  return verb.add_option("--view", flags.view, "Name of the view that the prompt is in");
}

}  // namespace

void AddPointFlags(CLI::App& verb, PromptFlags& flags) {
  AddSceneAndView(verb, flags)->required();
  AddNegative(verb, flags, AddPoint(verb, flags)->required());
}

CLI::Option_group* AddPromptFlags(CLI::App& verb, PromptFlags& flags, bool optional) {
  CLI::Option* view = AddSceneAndView(verb, flags);
  // The group holds the flags of which exactly one kind must be given; the others add to one.
  CLI::Option_group* what = verb.add_option_group("prompt", "The prompt");
  CLI::Option* point = AddPoint(*what, flags)->needs(view);
  CLI::Option* scribble = AddPart(*what, flags, "--scribble", "scribble", "\"X,Y X,Y ...\"",
                                  "A line over the object; may be repeated")
                              ->needs(view);
  AddPart(*what, flags, "--box", "box", "X,Y,WIDTH,HEIGHT", "A box around the object")
      ->needs(view)
      ->expected(1);
  AddPart(*what, flags, "--mask", "mask", "FILE",
          "A grey PNG of the frame's size: 0 outside the object")
      ->needs(view)
      ->expected(1);
  AddPart(*what, flags, "--label", "label", "ID", "A label of the scene: its mask and view")
      ->excludes(view)
      ->expected(1);
  what->require_option(optional ? 0 : 1, 1);
  AddNegative(verb, flags, point);
  AddPart(verb, flags, "--not-scribble", "not-scribble", "\"X,Y X,Y ...\"",
          "A line over what is not the object; may be repeated")
      ->needs(scribble);
  verb.add_option("--stroke-width", flags.stroke_width, "Width of the lines, pixels; 0: thin")
      ->check(CLI::Range(0.0, 256.0))
      ->needs(scribble);
  return what;
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
  if (!flags.view.empty()) prompt.mutable_view()->set_view(flags.view);
  // The parser reads the flags of the group last.
  auto parts = flags.parts;
  std::stable_partition(parts.begin(), parts.end(), [](const auto& part) {
    return part.first != "negative" && part.first != "not-scribble" &&
           part.first != "previous-mask";
  });
  for (const auto& [kind, text] : parts) RETURN_IF_ERROR(AddToPrompt(kind, text, prompt));
  if (prompt.has_scribbles()) {
    for (auto& stroke : *prompt.mutable_scribbles()->mutable_strokes()) {
      stroke.set_width(flags.stroke_width);
    }
  }
  return prompt;
}

void SetTargets(const std::vector<std::string>& names, v1::SegmentViewsRequest::Targets& targets) {
  for (const std::string& name : names) {
    if (name == "all") {
      targets.set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
    } else if (name == "held-out") {
      targets.set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
    } else {
      targets.add_views(name);
    }
  }
}

void AddSamClicksFlag(CLI::App& verb, std::optional<bool>& sam_clicks) {
  verb.add_flag("--sam-clicks,!--no-sam-clicks", sam_clicks,
                "Let SAM and the model answer points or a box together, in the photographs; by "
                "default where the model was trained with SAM's masks");
}

void AddScalesFlag(CLI::App& verb, std::vector<double>& scales) {
  verb.add_option(
          "--scales", scales,
          "Scales of the levels: quantiles, ascending, separated by commas; by default 0.01,0.5,1")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(0.0, 1.0));
}

void AddSubsetFlags(CLI::App& verb, SubsetFlags& flags, CLI::App* group) {
  CLI::App& naming = group == nullptr ? verb : *group;
  CLI::Option* selection = naming
                               .add_option("--selection", flags.selection,
                                           "Only the Gaussians of this selection, by number")
                               ->check(CLI::PositiveNumber);
  naming
      .add_option("--segment", flags.segment,
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

absl::StatusOr<std::string> WriteOrigin(const v1::Vector3* origin, const std::string& file) {
  const std::string path = file + ".origin.json";
  if (origin == nullptr) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    return std::string();
  }
  const nlohmann::ordered_json json = {{"origin", {origin->x(), origin->y(), origin->z()}}};
  RETURN_IF_ERROR(WriteFile(path, json.dump() + "\n"));
  return path;
}

}  // namespace pepeseg::client::cli
