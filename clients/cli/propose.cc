// The verb "propose": the objects that a click may mean.
#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/picture.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/shell.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

struct ProposeFlags {
  PromptFlags prompt;
  int max_proposals = 0;  // 0: the server's default
  std::string out;        // folder for overlays; empty: none
};

// Returns "part", "object" or "group"; "" for another kind.
std::string KindName(v1::ProposeScalesResponse::Kind kind) {
  switch (kind) {
    case v1::ProposeScalesResponse::KIND_PART:
      return "part";
    case v1::ProposeScalesResponse::KIND_OBJECT:
      return "object";
    case v1::ProposeScalesResponse::KIND_GROUP:
      return "group";
    default:
      return "";
  }
}

// Prints the proposals from small to large; '*' marks the best.
void PrintAnswer(const v1::ProposeScalesResponse& answer) {
  Print(answer.model());
  for (int i = 0; i < answer.proposals_size(); ++i) {
    const auto& proposal = answer.proposals(i);
    Print(
        absl::StrFormat("%c %-6s  scale %.2f (%.4g scene units)  threshold %.2f  %8d px  "
                        "support %.2f  stability %.2f",
                        i == answer.best() ? '*' : ' ', KindName(proposal.kind()),
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
    ASSIGN_OR_RETURN(const Picture overlay,
                     DrawnOver(client, answer.model(),
                               {answer.proposals(i).mask(), request.prompt().points().points(),
                                request.frame()}));
    const fs::path path =
        fs::path(flags.out) / absl::StrCat(Stem(flags.prompt.view), "_", i + 1, ".png");
    RETURN_IF_ERROR(WritePng(path, overlay));
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

void AddPropose(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ProposeFlags>();
  CLI::App* verb = app.add_subcommand(
      "propose", "Propose what a click may mean: the scales at which its mask is stable");
  AddPromptFlags(*verb, flags->prompt);
  verb->add_option("--max", flags->max_proposals, "Maximum number of proposals")
      ->check(CLI::Range(1, 16));
  verb->add_option("--out", flags->out, "Folder for STEM_1.png, STEM_2.png, ...");
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunPropose(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
