#include "clients/cli/evaluation_prompts.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cli/request_flags.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

// Parses "440,280;-100,80".
absl::StatusOr<v1::PointsPrompt> ParsePointList(const std::string& text) {
  v1::PointsPrompt points;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(text, ';'))) {
    const bool negative = part.starts_with('-');
    ASSIGN_OR_RETURN(*points.add_points(), ParsePoint(part.substr(negative ? 1 : 0), negative));
  }
  return points;
}

absl::StatusOr<v1::EntityPrompt::Scribbles> ReadScribbles(const std::string& files) {
  const std::pair<std::string, std::string> names = absl::StrSplit(files, absl::MaxSplits(',', 1));
  v1::EntityPrompt::Scribbles scribbles;
  ASSIGN_OR_RETURN(*scribbles.mutable_positive()->mutable_png(), ReadFile(names.first));
  if (names.second.empty()) return scribbles;
  ASSIGN_OR_RETURN(*scribbles.mutable_negative()->mutable_png(), ReadFile(names.second));
  return scribbles;
}

// Sets the prompt from its kind and value. INVALID_ARGUMENT: the kind is not known.
absl::Status SetWhat(const std::string& kind, const std::string& value, v1::EntityPrompt& prompt) {
  if (kind == "points") {
    ASSIGN_OR_RETURN(*prompt.mutable_points(), ParsePointList(value));
  } else if (kind == "mean") {
    ASSIGN_OR_RETURN(*prompt.mutable_point_mean(), ParsePointList(value));
  } else if (kind == "box") {
    ASSIGN_OR_RETURN(*prompt.mutable_box(), ParseBox(value));
  } else if (kind == "mask") {
    ASSIGN_OR_RETURN(*prompt.mutable_mask()->mutable_png(), ReadFile(value));
  } else if (kind == "scribbles") {
    ASSIGN_OR_RETURN(*prompt.mutable_scribbles(), ReadScribbles(value));
  } else if (kind == "own-mask") {
    prompt.mutable_own_mask();
  } else if (kind == "label") {
    prompt.set_label_id(value);
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", kind, "\": one of points, mean, box, mask, scribbles, own-mask, label"));
  }
  return absl::OkStatus();
}

v1::ViewTruth* TruthOfView(const std::string& view, v1::EvaluateModelRequest& request) {
  auto& views = *request.mutable_views();
  const auto found = std::find_if(views.begin(), views.end(),
                                  [&](const v1::ViewTruth& truth) { return truth.view() == view; });
  return found == views.end() ? nullptr : &*found;
}

absl::StatusOr<std::vector<std::string>> PromptLines(const EntityPromptFlags& flags) {
  std::vector<std::string> lines = flags.prompts;
  if (flags.file.empty()) return lines;
  ASSIGN_OR_RETURN(const std::string text, ReadFile(flags.file));
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const absl::string_view prompt = absl::StripAsciiWhitespace(line);
    if (!prompt.empty() && prompt.front() != '#') lines.emplace_back(prompt);
  }
  return lines;
}

// Makes the masks of a view the prompts of their entities.
absl::Status AddReference(const std::string& view, v1::EvaluateModelRequest& request) {
  const v1::ViewTruth* truth = TruthOfView(view, request);
  if (truth == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("--reference ", view, ": the view is not scored or has no masks"));
  }
  ASSIGN_OR_RETURN(const std::vector<std::string> entities, EntitiesOf(request, *truth));
  for (const std::string& entity : entities) {
    v1::EntityPrompt& prompt = *request.add_prompts();
    prompt.set_entity(entity);
    prompt.set_view(view);
    prompt.mutable_own_mask();
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::EntityPrompt> ParseEntityPrompt(const std::string& text) {
  const auto bad = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("prompt \"", text, "\": ", what));
  };
  const size_t at = text.find('@');
  const size_t colon = at == std::string::npos ? at : text.find(':', at);
  if (colon == std::string::npos || at == 0) {
    return bad("expected ENTITY@VIEW:KIND:VALUE, such as mug@a.jpg:points:440,280");
  }
  v1::EntityPrompt prompt;
  prompt.set_entity(text.substr(0, at));
  prompt.set_view(text.substr(at + 1, colon - at - 1));
  const std::pair<std::string, std::string> what =
      absl::StrSplit(text.substr(colon + 1), absl::MaxSplits(':', 1));
  if (prompt.view().empty() != (what.first == "label")) {
    return bad("a label has its own view, all other prompts need one");
  }
  const absl::Status status = SetWhat(what.first, what.second, prompt);
  if (status.ok()) return prompt;
  return IsLocalFileError(status) ? status : bad(status.message());
}

absl::Status AddEntityPrompts(const EntityPromptFlags& flags, const TruthFlags& truth,
                              v1::EvaluateModelRequest& request) {
  ASSIGN_OR_RETURN(const std::vector<std::string> lines, PromptLines(flags));
  for (const std::string& line : lines) {
    ASSIGN_OR_RETURN(*request.add_prompts(), ParseEntityPrompt(line));
    const std::string& view = request.prompts(request.prompts_size() - 1).view();
    if (view.empty() || TruthOfView(view, request) != nullptr) continue;
    v1::ViewTruth& reference = *request.add_views();
    reference.set_view(view);
    ASSIGN_OR_RETURN(*reference.mutable_ignore_png(), IgnorePng(truth, view));
  }
  if (flags.reference.empty()) return absl::OkStatus();
  return AddReference(flags.reference, request);
}

}  // namespace pepeseg::client::cli
