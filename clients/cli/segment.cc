// The verbs "segment", masks of what a prompt means, in any view, and "propose", the objects that a
// click may mean.
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/accepted_mask.h"
#include "clients/cli/find.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/picture.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

struct SegmentFlags {
  PromptFlags prompt;
  std::string text;  // in place of the prompt; empty: none
  GranularityFlags granularity;
  std::vector<std::string> targets;  // names of views, "all" or "held-out"
  bool refine_borders = true;
  std::optional<bool> sam_borders, sam_clicks;  // absent: as the server chooses
  std::string out;
};

// Returns the prompt for the best thing that --text names. NOT_FOUND: see CheckFound.
absl::StatusOr<v1::Prompt> PromptOfText(const Client& client, const SegmentFlags& flags) {
  v1::FindSegmentsRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  request.set_text(flags.text);
  request.set_max_results(1);
  request.set_frame(flags.prompt.frame);
  ASSIGN_OR_RETURN(const v1::FindSegmentsResponse answer, client.Find(request));
  RETURN_IF_ERROR(CheckFound(answer));
  const auto& found = answer.found(0);
  Note(absl::StrFormat("%s, score %.2f, by %s", found.word(), found.score(),
                       WordOf(answer.source())));
  return found.prompt();
}

absl::StatusOr<v1::SegmentViewsRequest> BuildRequest(const Client& client,
                                                     const SegmentFlags& flags) {
  v1::SegmentViewsRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  if (flags.text.empty()) {
    ASSIGN_OR_RETURN(*request.mutable_prompt(), ParsePrompt(flags.prompt));
  } else {
    ASSIGN_OR_RETURN(*request.mutable_prompt(), PromptOfText(client, flags));
  }
  *request.mutable_granularity() = ToGranularity(flags.granularity);
  if (!flags.targets.empty()) SetTargets(flags.targets, *request.mutable_targets());
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  request.set_frame(flags.prompt.frame);
  request.set_refine_borders(flags.refine_borders);
  if (flags.sam_borders) request.set_sam_borders(*flags.sam_borders);
  if (flags.sam_clicks) request.set_sam_clicks(*flags.sam_clicks);
  return request;
}

// Writes STEM_mask.png, and STEM_overlay.png, the mask over a rendering of the view.
absl::Status WriteMaskAndOverlay(const Client& client, const SegmentFlags& flags,
                                 const v1::SegmentViewsRequest& request,
                                 const v1::SegmentViewsResponse& answer,
                                 const v1::SegmentViewsResponse::ViewMask& view) {
  const fs::path stem = fs::path(flags.out) / Stem(view.view());
  RETURN_IF_ERROR(WriteMask(stem.string() + "_mask.png", view.rle()));
  Points points;
  if (view.view() == request.prompt().view().view()) points = request.prompt().points().points();
  return WriteDrawnOver(stem.string() + "_overlay.png", client, answer.model(),
                        {view, points, request.frame()});
}

// Says how far the training is that the answer comes from.
void NoteSnapshot(const v1::SegmentViewsResponse& answer) {
  if (!answer.has_snapshot()) return;
  const v1::Snapshot& state = answer.snapshot();
  Note(absl::StrFormat("%s is still training: this is step %d of %d of stage %s", state.job(),
                       state.step(), state.num_steps(), WordOf(state.stage())));
}

// Prints the granularity used, and a line for each mask.
void PrintAnswer(const v1::SegmentViewsResponse& answer) {
  Print(absl::StrFormat("%s  scale %.3f (%.4g scene units)  threshold %.3f", answer.model(),
                        answer.scale_quantile(), answer.scale_units(), answer.threshold()));
  for (const auto& mask : answer.masks()) {
    Print(absl::StrFormat("  %-28s %8d px  score %.3f  box %d,%d %dx%d", mask.view(), mask.area(),
                          mask.score(), mask.box().x(), mask.box().y(), mask.box().width(),
                          mask.box().height()));
  }
}

// Warns if the model shows nothing that fills the box of the prompt.
void WarnOfBox(const v1::SegmentViewsResponse& answer) {
  constexpr double kFits = 0.5;
  if (!answer.has_box_agreement() || answer.box_agreement() >= kFits) return;
  Note(
      absl::StrFormat("nothing in the model fills the box (agreement %.2f): the mask is what of "
                      "the best fit lies in it; draw the box around a thing, or click",
                      answer.box_agreement()));
}

absl::Status RunSegment(const Shell& shell, const SegmentFlags& flags) {
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::SegmentViewsRequest request, BuildRequest(client, flags));
  ASSIGN_OR_RETURN(v1::SegmentViewsResponse answer, client.Segment(request));
  RETURN_IF_ERROR(TakeAcceptedMask(client, request, answer));
  for (const auto& mask : answer.masks()) {
    if (!flags.out.empty()) {
      RETURN_IF_ERROR(WriteMaskAndOverlay(client, flags, request, answer, mask));
    }
  }
  shell.json ? PrintJson(answer) : PrintAnswer(answer);
  WarnOfBox(answer);
  NoteSnapshot(answer);
  if (!flags.out.empty()) Note(absl::StrCat("masks and overlays are in ", flags.out));
  return absl::OkStatus();
}

struct ProposeFlags {
  PromptFlags prompt;
  int max_proposals = 0;  // 0: the server's default
  std::string out;        // folder for overlays; empty: none
};

// Prints the proposals from small to large; '*' marks the best.
void PrintAnswer(const v1::ProposeScalesResponse& answer) {
  Print(answer.model());
  for (int i = 0; i < answer.proposals_size(); ++i) {
    const auto& proposal = answer.proposals(i);
    Print(
        absl::StrFormat("%c %-6s  scale %.2f (%.4g scene units)  threshold %.2f  %8d px  "
                        "support %.2f  stability %.2f",
                        i == answer.best() ? '*' : ' ', WordOf(proposal.kind()),
                        proposal.scale_quantile(), proposal.scale_units(), proposal.threshold(),
                        proposal.mask().area(), proposal.support(), proposal.stability()));
  }
  if (!answer.proposals().empty()) Print("* the answer of `pepeseg segment` without --scale");
  if (answer.proposals().empty()) Print("  nothing stable is under the click");
}

// Writes STEM_1.png for the smallest proposal, STEM_2.png for the next, and so on.
absl::Status WriteOverlays(const Client& client, const ProposeFlags& flags,
                           const v1::ProposeScalesRequest& request,
                           const v1::ProposeScalesResponse& answer) {
  for (int i = 0; i < answer.proposals_size(); ++i) {
    const fs::path path =
        fs::path(flags.out) / absl::StrCat(Stem(flags.prompt.view), "_", i + 1, ".png");
    RETURN_IF_ERROR(WriteDrawnOver(
        path, client, answer.model(),
        {answer.proposals(i).mask(), request.prompt().points().points(), request.frame()}));
  }
  return absl::OkStatus();
}

absl::Status RunPropose(const Shell& shell, const ProposeFlags& flags) {
  v1::ProposeScalesRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  ASSIGN_OR_RETURN(*request.mutable_prompt(), ParsePrompt(flags.prompt));
  request.set_max_proposals(flags.max_proposals);
  request.set_frame(flags.prompt.frame);
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::ProposeScalesResponse answer, client.ProposeScales(request));
  if (!flags.out.empty()) RETURN_IF_ERROR(WriteOverlays(client, flags, request, answer));
  shell.json ? PrintJson(answer) : PrintAnswer(answer);
  if (!flags.out.empty()) Note(absl::StrCat("overlays are in ", flags.out));
  return absl::OkStatus();
}

}  // namespace

void AddSegment(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<SegmentFlags>();
  CLI::App* verb = app.add_subcommand("segment", "Segment what a click means, in any view");
  AddPromptFlags(*verb, flags->prompt, /*optional=*/true);
  verb->add_option("--text", flags->text,
                   "In place of a prompt: the best thing of this name, as `find` finds it");
  AddGranularityFlags(*verb, flags->granularity);
  AddNamesFlag(*verb, "--views", flags->targets,
               "Views to segment: names, all or held-out; by default the view of the prompt");
  verb->add_flag("!--no-refine-borders", flags->refine_borders,
                 "Masks are exactly the pixels above the threshold");
  verb->add_flag(
      "--sam-borders,!--no-sam-borders", flags->sam_borders,
      "Let SAM place the borders of the masks in the photographs; by default where the model was "
      "trained with SAM's masks");
  AddSamClicksFlag(*verb, flags->sam_clicks);
  verb->add_option("--out", flags->out, "Folder for STEM_mask.png and STEM_overlay.png");
  verb->callback([flags, &shell] {
    if (flags->text.empty() == flags->prompt.parts.empty()) {
      throw CLI::ValidationError(
          "segment", "give either a prompt, such as --view VIEW --point X,Y, or --text TEXT");
    }
    shell.verb = [&, flags] { return RunSegment(shell, *flags); };
  });
}

void AddPropose(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ProposeFlags>();
  CLI::App* verb = app.add_subcommand(
      "propose", "Propose what a click may mean: the scales at which its mask is stable");
  AddPointFlags(*verb, flags->prompt);
  verb->add_option("--max", flags->max_proposals, "Maximum number of proposals")
      ->check(CLI::Range(1, 16));
  verb->add_option("--out", flags->out, "Folder for STEM_1.png, STEM_2.png, ...");
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunPropose(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
