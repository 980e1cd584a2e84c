// The verb "evaluate": scores models against the truth.
#include "clients/benchmark/evaluate.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/benchmark/evaluation_table.h"
#include "clients/benchmark/evaluation_truth.h"
#include "clients/benchmark/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {
namespace {

// Sets a prompt from its kind and value. INVALID_ARGUMENT: the kind is not known.
absl::Status SetWhat(const std::string& kind, const std::string& value, v1::Prompt& prompt) {
  if (kind == "points" || kind == "mean") {
    for (const std::string& part : std::vector<std::string>(absl::StrSplit(value, ';'))) {
      const bool negative = kind == "points" && part.starts_with('-');
      RETURN_IF_ERROR(AddToPrompt(kind == "mean" ? "mean"
                                  : negative     ? "negative"
                                                 : "point",
                                  part.substr(negative ? 1 : 0), prompt));
    }
    return absl::OkStatus();
  }
  if (kind == "scribbles") {
    const std::pair<std::string, std::string> files =
        absl::StrSplit(value, absl::MaxSplits(',', 1));
    RETURN_IF_ERROR(AddToPrompt("scribbles", files.first, prompt));
    return files.second.empty() ? absl::OkStatus()
                                : AddToPrompt("not-scribbles", files.second, prompt);
  }
  if (kind == "box" || kind == "mask" || kind == "label") return AddToPrompt(kind, value, prompt);
  return absl::InvalidArgumentError(
      absl::StrCat("\"", kind, "\": one of points, mean, box, mask, scribbles, own-mask, label"));
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
    (*request.mutable_own_masks())[entity] = view;
  }
  return absl::OkStatus();
}

namespace fs = std::filesystem;

constexpr size_t kMaxRequestBytes = size_t{8} << 20;  // what a server takes

struct EvaluateFlags {
  std::vector<std::string> models;  // and, last, the folder or file of the truth
  std::string model = "live";       // of models that are given as a scene
  TruthFlags truth;
  EntityPromptFlags prompts;
  v1::EvaluationProtocol protocol = v1::EVALUATION_PROTOCOL_PROMPT;
  std::vector<double> scales, thresholds;
  std::optional<double> threshold, min_cosine, min_iou;
  std::optional<int64_t> min_pixels;
  std::optional<int> ignore_label;  // absent: see EvaluateModelRequest.ignore_label
  std::optional<int> max_clicks;
  bool score_reference = false;
  bool refine_borders = true;
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;  // of the images, prompts and clicks
};

// Returns the name of a model that is given as SCENE, SCENE/NUMBER or its name.
std::string NameOfModel(const std::string& text, const std::string& number) {
  if (text.find("/models/") != std::string::npos) return text;
  const size_t slash = text.find('/');
  if (slash == std::string::npos || text.starts_with("scenes/") || text.starts_with("projects/")) {
    return ModelName(text, number);
  }
  return ModelName(text.substr(0, slash), text.substr(slash + 1));
}

v1::EvaluationOptions EvaluationOptionsOf(const EvaluateFlags& flags) {
  v1::EvaluationOptions options;
  options.set_protocol(flags.protocol);
  options.mutable_scales()->Assign(flags.scales.begin(), flags.scales.end());
  options.mutable_thresholds()->Assign(flags.thresholds.begin(), flags.thresholds.end());
  if (flags.threshold) options.set_fixed_threshold(*flags.threshold);
  if (flags.min_pixels) {
    options.set_min_pixels(*flags.min_pixels);
    options.mutable_sam_agreement()->set_min_pixels(*flags.min_pixels);
  }
  options.set_score_reference(flags.score_reference);
  options.set_refine_borders(flags.refine_borders);
  options.set_accept_trained_views(flags.truth.trained_views);
  if (flags.min_cosine) {
    options.mutable_label_propagation()->set_min_cosine(*flags.min_cosine);
    options.mutable_promptable()->set_min_cosine(*flags.min_cosine);
  }
  if (flags.min_iou) options.mutable_clicks()->set_min_iou(*flags.min_iou);
  if (flags.max_clicks) options.mutable_clicks()->set_max_clicks(*flags.max_clicks);
  return options;
}

// Returns a request for the first of the models.
absl::StatusOr<v1::EvaluateModelRequest> MakeRequest(const Client& client,
                                                     const EvaluateFlags& flags,
                                                     const std::string& model) {
  v1::EvaluateModelRequest request;
  request.set_model(model);
  request.set_frame(flags.frame);
  *request.mutable_options() = EvaluationOptionsOf(flags);
  if (flags.ignore_label) request.set_ignore_label(*flags.ignore_label);
  if (!flags.truth.names.empty()) RETURN_IF_ERROR(AddNames(flags.truth.names, request));
  ASSIGN_OR_RETURN(const std::vector<v1::View> all, client.ListViews(model));
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, ViewsToScore(flags.truth, all));
  const bool by_sam = flags.protocol == v1::EVALUATION_PROTOCOL_SAM_AGREEMENT;
  std::vector<std::string> without;
  if (by_sam) {
    ASSIGN_OR_RETURN(without, AddSamMasks(flags.truth, views, request));
  } else {
    ASSIGN_OR_RETURN(AddedTruth added, AddTruth(flags.truth, views, request));
    const std::string unknown = UnknownPhotographs(added.outlines, all);
    if (!unknown.empty()) Note(unknown);
    without = std::move(added.views_without);
  }
  if (!without.empty()) {
    Note(absl::StrCat(without.size(), " views have nothing in ", flags.truth.folder.string(),
                      ", such as ", without.front()));
  }
  if (!by_sam) RETURN_IF_ERROR(AddEntityPrompts(flags.prompts, flags.truth, request));
  if (request.ByteSizeLong() <= kMaxRequestBytes) return request;
  return absl::InvalidArgumentError(absl::StrCat("the images have ", request.ByteSizeLong(),
                                                 " bytes, a request may have ", kMaxRequestBytes,
                                                 "; score fewer views at a time (--views)"));
}

void PrintEvaluations(const Shell& shell, const std::vector<v1::EvaluateModelResponse>& responses) {
  const bool several = responses.size() > 1;
  if (shell.json) {
    if (several) return Print(SpreadJson(responses).dump());
    return PrintJson(responses[0]);
  }
  for (const v1::EvaluateModelResponse& response : responses) {
    Print(response.model());
    for (const std::string& line : EvaluationTable(response)) Print(line);
    if (several) Print("");
  }
  if (!several) return;
  for (const std::string& line : SpreadTable(responses)) Print(line);
}

absl::Status RunEvaluate(const Shell& shell, EvaluateFlags flags) {
  flags.truth.folder = flags.models.back();
  flags.models.pop_back();
  const fs::path& truth = flags.truth.folder;
  const bool by_sam = flags.protocol == v1::EVALUATION_PROTOCOL_SAM_AGREEMENT;
  std::error_code error;
  if (!fs::is_directory(truth, error) && (by_sam || !fs::is_regular_file(truth, error))) {
    return LocalFileMissing(
        absl::StrCat("no such folder", by_sam ? "" : " or file of outlines", ": ", truth.string()));
  }
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(v1::EvaluateModelRequest request,
                   MakeRequest(client, flags, NameOfModel(flags.models[0], flags.model)));
  std::vector<v1::EvaluateModelResponse> responses;
  for (const std::string& model : flags.models) {
    request.set_model(NameOfModel(model, flags.model));
    ASSIGN_OR_RETURN(responses.emplace_back(), client.Evaluate(request));
  }
  PrintEvaluations(shell, responses);
  return absl::OkStatus();
}

void AddTruthFlags(CLI::App& verb, EvaluateFlags& flags) {
  verb.add_option("--ignore", flags.truth.ignore,
                  "A grey PNG for all views, or a folder of STEM.png: pixels that are not 0 are "
                  "not scored");
  verb.add_option("--ignore-label", flags.ignore_label,
                  "Id of void pixels in label images: in no entity, and not scored; default: 255 "
                  "where an image has other ids as well and none over 255")
      ->check(CLI::Range(1, 65535));
  verb.add_option("--names", flags.truth.names, "JSON file with the entities' names by id");
  AddNamesFlag(verb, "--views", flags.truth.views,
               "Names of the views to score; by default the held-out ones")
      ->allow_extra_args(false);
  verb.add_flag("--trained-views", flags.truth.trained_views,
                "Also score views that the model was trained on, as some protocols do");
}

void AddPromptsFlags(CLI::App& verb, EntityPromptFlags& flags) {
  verb.add_option("--prompt", flags.prompts,
                  "Prompt of an entity instead of one click: ENTITY@VIEW:KIND:VALUE with KIND "
                  "points, mean, box, mask, scribbles, own-mask or label; may be repeated")
      ->allow_extra_args(false);
  verb.add_option("--prompts", flags.file, "A file with such prompts, one a line");
  verb.add_option("--reference", flags.reference,
                  "A view whose masks are the prompts of their entities");
}

void AddOptionFlags(CLI::App& verb, EvaluateFlags& flags) {
  std::vector<std::string> protocols;
  for (const auto& [name, protocol] : ProtocolsByName()) protocols.push_back(name);
  verb.add_option_function<std::string>(
          "--protocol",
          [&flags](const std::string& name) { flags.protocol = ProtocolsByName().at(name); },
          "prompt (default), label-propagation, label-propagation-pixels, promptable, clicks or "
          "sam-agreement")
      ->check(CLI::IsMember(protocols));
  verb.add_option("--scales", flags.scales, "Scales to choose from, quantiles")->delimiter(',');
  verb.add_option("--thresholds", flags.thresholds, "Thresholds to choose from, cosines")
      ->delimiter(',');
  verb.add_option("--threshold", flags.threshold, "Threshold (cosine) of one scale for all")
      ->check(CLI::Range(-1.0, 1.0));
  verb.add_option("--min-pixels", flags.min_pixels, "Pixels of an entity that a view must show");
  verb.add_option("--min-cosine", flags.min_cosine,
                  "Threshold of label-propagation[-pixels] and promptable (0.7, 0.9)");
  verb.add_option("--min-iou", flags.min_iou, "IoU that clicks must reach (0.9)");
  verb.add_option("--max-clicks", flags.max_clicks, "Maximum number of clicks (10)");
  verb.add_flag("--score-reference", flags.score_reference, "Score the reference view, too");
  verb.add_flag("!--no-refine-borders", flags.refine_borders,
                "Score masks that are exactly the pixels above the threshold");
}

}  // namespace

absl::StatusOr<std::string> AddEntityPrompt(const std::string& text,
                                            v1::EvaluateModelRequest& request) {
  const auto bad = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("prompt \"", text, "\": ", what));
  };
  const size_t at = text.find('@');
  const size_t colon = at == std::string::npos ? at : text.find(':', at);
  if (colon == std::string::npos || at == 0) {
    return bad("expected ENTITY@VIEW:KIND:VALUE, such as mug@a.jpg:points:440,280");
  }
  const std::string entity = text.substr(0, at), view = text.substr(at + 1, colon - at - 1);
  const std::pair<std::string, std::string> what =
      absl::StrSplit(text.substr(colon + 1), absl::MaxSplits(':', 1));
  if (view.empty() != (what.first == "label")) {
    return bad("a label has its own view, all other prompts need one");
  }
  if (request.prompts().contains(entity) || request.own_masks().contains(entity)) {
    return bad("the entity has a prompt already");
  }
  if (what.first == "own-mask") {
    (*request.mutable_own_masks())[entity] = view;
    return view;
  }
  v1::Prompt prompt;
  if (!view.empty()) prompt.mutable_view()->set_view(view);
  const absl::Status status = SetWhat(what.first, what.second, prompt);
  if (IsLocalFileError(status)) return status;
  if (!status.ok()) return bad(status.message());
  (*request.mutable_prompts())[entity] = std::move(prompt);
  return view;
}

absl::Status AddEntityPrompts(const EntityPromptFlags& flags, const TruthFlags& truth,
                              v1::EvaluateModelRequest& request) {
  ASSIGN_OR_RETURN(const std::vector<std::string> lines, PromptLines(flags));
  for (const std::string& line : lines) {
    ASSIGN_OR_RETURN(const std::string view, AddEntityPrompt(line, request));
    if (view.empty() || TruthOfView(view, request) != nullptr) continue;
    v1::ViewTruth& reference = *request.add_views();
    reference.set_view(view);
    ASSIGN_OR_RETURN(*reference.mutable_ignore_png(), IgnorePng(truth, view));
  }
  if (flags.reference.empty()) return absl::OkStatus();
  return AddReference(flags.reference, request);
}

void AddEvaluate(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<EvaluateFlags>();
  CLI::App* verb = app.add_subcommand("evaluate", "Score models against the truth of views");
  verb->add_option(
          "MODEL", flags->models,
          "Models, each SCENE (the live model, or --model), SCENE/NUMBER or a name, and last "
          "the folder of the truth. It has label images STEM.png, named as the photographs: grey, "
          "8 or 16 bits, the entity's id in each pixel, 0 for none; or binary masks "
          "STEM/ENTITY.png; or outlines, STEM.json of LabelMe or COCO's JSON, which may also be "
          "a file, or in labels/, annotations.json, annotations/ or images/ of a scene's folder; "
          "for sam-agreement STEM.json of SAM, or masks STEM/*.png")
      ->required()
      ->option_text("... TRUTH")
      ->expected(2, 100);
  verb->add_option("--model", flags->model, "Number of the model of a scene")
      ->capture_default_str();
  AddTruthFlags(*verb, *flags);
  AddPromptsFlags(*verb, flags->prompts);
  AddOptionFlags(*verb, *flags);
  AddFrameFlag(*verb, flags->frame);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunEvaluate(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
