// The verbs "label" and "labels": names for the masks of views.
#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

struct LabelFlags {
  PromptFlags prompt;
  GranularityFlags granularity;
  std::string id;
  std::string text;
};

struct LabelsFlags {
  std::string scene;
  std::string id;      // of the label to describe; empty: list all
  std::string out;     // folder for its mask; empty: do not write it
  std::string remove;  // id of the label to delete; empty: none
  // Frame of the mask that is written.
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;
};

// Returns the name, view, area and text of a label.
std::string LabelLine(const v1::Label& label) {
  return absl::StrFormat("%-36s %s  %d px  %s", label.name(), label.view(), label.area(),
                         label.text());
}

// Sets the view and the mask of a label: a mask that is given, or what the prompt means in its
// view.
absl::Status SetMask(const Client& client, const LabelFlags& flags, v1::Label& label) {
  ASSIGN_OR_RETURN(const v1::Prompt prompt, ParsePrompt(flags.prompt));
  label.set_view(flags.prompt.view);
  *label.mutable_mask() = prompt.mask();
  if (prompt.has_mask()) return absl::OkStatus();
  v1::SegmentViewsRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  *request.mutable_prompt() = prompt;
  *request.mutable_granularity() = ToGranularity(flags.granularity);
  request.set_frame(flags.prompt.frame);
  ASSIGN_OR_RETURN(const v1::SegmentViewsResponse answer, client.Segment(request));
  if (answer.masks_size() != 1) return absl::InternalError("the server's answer has no mask");
  label.set_view(answer.masks(0).view());
  *label.mutable_mask()->mutable_rle() = answer.masks(0).rle();
  return absl::OkStatus();
}

absl::Status RunLabel(const Shell& shell, const LabelFlags& flags) {
  const Client client(shell.channel);
  v1::CreateLabelRequest request;
  request.set_parent(SceneName(flags.prompt.scene));
  request.set_label_id(flags.id);
  request.mutable_label()->set_text(flags.text);
  request.set_frame(flags.prompt.frame);
  RETURN_IF_ERROR(SetMask(client, flags, *request.mutable_label()));
  ASSIGN_OR_RETURN(const v1::Label label, client.CreateLabel(std::move(request)));
  shell.json ? PrintJson(label) : Print(LabelLine(label));
  return absl::OkStatus();
}

absl::Status ListLabels(const Shell& shell, const Client& client, const std::string& scene) {
  ASSIGN_OR_RETURN(const auto all, client.ListLabels(scene));
  if (shell.json) {
    PrintJson(all);
  } else {
    for (const v1::Label& label : all.labels()) Print(LabelLine(label));
  }
  return absl::OkStatus();
}

// Prints a label, and writes ID_mask.png.
absl::Status DescribeLabel(const Shell& shell, const Client& client, const LabelsFlags& flags) {
  const std::string name = absl::StrCat(SceneName(flags.scene), "/labels/", flags.id);
  ASSIGN_OR_RETURN(const v1::Label label, client.GetLabel(name, flags.frame));
  shell.json ? PrintJson(label) : Print(LabelLine(label));
  if (flags.out.empty()) return absl::OkStatus();
  const auto path = std::filesystem::path(flags.out) / (flags.id + "_mask.png");
  RETURN_IF_ERROR(WriteMask(path, label.mask().rle()));
  Note(absl::StrCat("the mask is in ", path.string()));
  return absl::OkStatus();
}

absl::Status RunLabels(const Shell& shell, const LabelsFlags& flags) {
  const Client client(shell.channel);
  const std::string scene = SceneName(flags.scene);
  if (!flags.remove.empty()) {
    return client.DeleteLabel(absl::StrCat(scene, "/labels/", flags.remove));
  }
  if (!flags.id.empty()) return DescribeLabel(shell, client, flags);
  return ListLabels(shell, client, scene);
}

}  // namespace

void AddLabel(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<LabelFlags>();
  CLI::App* verb = app.add_subcommand("label", "Give a name to what a mask of a view shows");
  AddPromptFlags(*verb, flags->prompt);
  verb->add_option("ID", flags->id, "Id of the label: letters, digits, '_', '.' and '-'")
      ->required();
  AddGranularityFlags(*verb, flags->granularity);
  verb->add_option("--text", flags->text, "Text of the label; by default the id");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunLabel(shell, *flags); }; });
}

void AddLabels(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<LabelsFlags>();
  CLI::App* verb = app.add_subcommand("labels", "List a scene's labels; describe or delete one");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  CLI::Option* id = verb->add_option("ID", flags->id, "Id of a label");
  verb->add_option("--out", flags->out, "Folder for ID_mask.png, the mask of the label")->needs(id);
  AddFrameFlag(*verb, flags->frame);
  verb->add_option("--delete", flags->remove, "Delete the label with this id")->excludes(id);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunLabels(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
