// The verbs "select", "selections" and "combine": sets of Gaussians in 3D.
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/gaussian_indices.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

struct SelectFlags {
  PromptFlags prompt;
  GranularityFlags granularity;
  int add_to = 0, subtract_from = 0, intersect = 0;  // numbers of selections; 0: not given
  int num_views = 0;                                 // that vote; 0: the server chooses
  bool keep_disconnected = false;
  std::optional<bool> sam_clicks;  // absent: as the server chooses
  std::string name;                // for people
  std::string indices;             // file with Gaussians in place of a prompt; "-": standard input
  std::string out;                 // folder for a picture; empty: none
};

struct SelectionsFlags {
  std::string scene;
  int number = 0;       // of a selection; 0: list all
  bool undo = false;    // describe its base
  bool remove = false;  // delete it
};

struct CombineFlags {
  std::string scene;
  int first = 0, second = 0;
  std::string operation;  // a key of Operations()
};

// Returns the operations by their names on the command line.
const std::map<std::string, v1::SetOperation>& Operations() {
  static const auto& operations =
      *new std::map<std::string, v1::SetOperation>{{"union", v1::SET_OPERATION_UNION},
                                                   {"subtract", v1::SET_OPERATION_SUBTRACT},
                                                   {"intersect", v1::SET_OPERATION_INTERSECT}};
  return operations;
}

std::string SelectionName(const std::string& scene, int number) {
  return absl::StrCat(SceneName(scene), "/selections/", number);
}

// Prints the name, model, size, extent, base and display name of a selection.
void PrintSelection(const Shell& shell, const v1::Selection& selection) {
  if (shell.json) return PrintJson(selection);
  std::string line = absl::StrFormat("%s  %s  %d Gaussians", selection.name(), selection.model(),
                                     selection.num_gaussians());
  if (selection.has_box()) {
    const v1::Vector3 &min = selection.box().min(), &max = selection.box().max();
    absl::StrAppendFormat(&line, "  %.4g x %.4g x %.4g scene units", max.x() - min.x(),
                          max.y() - min.y(), max.z() - min.z());
  }
  if (!selection.base().empty()) absl::StrAppend(&line, "  from ", selection.base());
  if (!selection.display_name().empty()) {
    absl::StrAppend(&line, "  \"", selection.display_name(), "\"");
  }
  Print(line);
}

// Sets the selection to combine the new one with, and how.
void SetBase(const SelectFlags& flags, v1::CreateSelectionRequest& request) {
  const auto set = [&](int number, v1::SetOperation operation) {
    if (number == 0) return;
    request.set_base(SelectionName(flags.prompt.scene, number));
    request.set_operation(operation);
  };
  set(flags.add_to, v1::SET_OPERATION_UNION);
  set(flags.subtract_from, v1::SET_OPERATION_SUBTRACT);
  set(flags.intersect, v1::SET_OPERATION_INTERSECT);
}

// Writes STEM_selection.png: the selection alone, rendered from the prompt's view.
absl::Status WritePicture(const Client& client, const SelectFlags& flags,
                          const v1::Selection& selection) {
  v1::RenderViewRequest request;
  request.set_model(selection.model());
  request.mutable_viewpoint()->set_view(flags.prompt.view);
  request.mutable_subset()->set_selection(selection.name());
  request.set_frame(flags.prompt.frame);
  ASSIGN_OR_RETURN(const v1::RenderViewResponse answer, client.Render(request));
  ASSIGN_OR_RETURN(const Picture picture, DecodePicture(answer.png(), flags.prompt.view));
  const fs::path path = fs::path(flags.out) / (Stem(flags.prompt.view) + "_selection.png");
  RETURN_IF_ERROR(WritePng(path, picture));
  Note(absl::StrCat("the selection is in ", path.string()));
  return absl::OkStatus();
}

// Sets the Gaussians whose indices are in the file, of the model that the request's name means now.
absl::Status SetGaussians(const Client& client, const std::string& file,
                          v1::CreateSelectionRequest& request) {
  ASSIGN_OR_RETURN(const std::string text, ReadIndices(file));
  ASSIGN_OR_RETURN(const v1::Model model, client.GetModel(request.model()));
  ASSIGN_OR_RETURN(*request.mutable_gaussians()->mutable_bits(),
                   BitsOfIndices(text, file, model.num_gaussians()));
  request.set_model(model.name());
  return absl::OkStatus();
}

absl::Status RunSelect(const Shell& shell, const SelectFlags& flags) {
  if (!flags.out.empty() && flags.prompt.view.empty()) {
    return absl::InvalidArgumentError(
        "--out renders the view of the prompt, and a label or indices have no --view");
  }
  const Client client(shell.channel);
  v1::CreateSelectionRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  if (flags.indices.empty()) {
    ASSIGN_OR_RETURN(*request.mutable_prompt(), ParsePrompt(flags.prompt));
  } else {
    RETURN_IF_ERROR(SetGaussians(client, flags.indices, request));
  }
  request.set_display_name(flags.name);
  *request.mutable_granularity() = ToGranularity(flags.granularity);
  request.set_num_views(flags.num_views);
  request.set_keep_disconnected(flags.keep_disconnected);
  if (flags.sam_clicks) request.set_sam_clicks(*flags.sam_clicks);
  request.set_frame(flags.prompt.frame);
  SetBase(flags, request);
  ASSIGN_OR_RETURN(const v1::Selection selection, client.Select(std::move(request)));
  PrintSelection(shell, selection);
  return flags.out.empty() ? absl::OkStatus() : WritePicture(client, flags, selection);
}

absl::Status ListSelections(const Shell& shell, const Client& client, const std::string& scene) {
  ASSIGN_OR_RETURN(const auto all, client.ListSelections(scene));
  if (shell.json) {
    PrintJson(all);
  } else {
    for (const v1::Selection& selection : all.selections()) PrintSelection(shell, selection);
  }
  return absl::OkStatus();
}

absl::Status RunSelections(const Shell& shell, const SelectionsFlags& flags) {
  const Client client(shell.channel);
  if (flags.number == 0) return ListSelections(shell, client, SceneName(flags.scene));
  const std::string name = SelectionName(flags.scene, flags.number);
  if (flags.remove) return client.DeleteSelection(name);
  ASSIGN_OR_RETURN(const v1::Selection selection,
                   flags.undo ? client.UndoSelection(name) : client.GetSelection(name));
  PrintSelection(shell, selection);
  return absl::OkStatus();
}

absl::Status RunCombine(const Shell& shell, const CombineFlags& flags) {
  const Client client(shell.channel);
  v1::CombineSelectionsRequest request;
  request.set_first(SelectionName(flags.scene, flags.first));
  request.set_second(SelectionName(flags.scene, flags.second));
  request.set_operation(Operations().at(flags.operation));
  ASSIGN_OR_RETURN(const v1::Selection selection, client.CombineSelections(std::move(request)));
  PrintSelection(shell, selection);
  return absl::OkStatus();
}

// Adds --indices to the kinds of prompts, which excludes what says how a prompt is meant.
void AddIndicesFlag(CLI::App& verb, CLI::Option_group& what, std::string& indices) {
  CLI::Option* option =
      what.add_option("--indices", indices,
                      "These Gaussians in place of a prompt: a text file (-: standard input) with "
                      "one index a line, from 0, in the order of an exported PLY")
          ->type_name("FILE");
  for (const char* of_prompt : {"--scale", "--scale-units", "--threshold", "--views",
                                "--keep-disconnected", "--sam-clicks"}) {
    option->excludes(verb.get_option(of_prompt));
  }
}

}  // namespace

void AddSelect(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<SelectFlags>();
  CLI::App* verb =
      app.add_subcommand("select", "Select the Gaussians of what a click means, in 3D");
  CLI::Option_group* what = AddPromptFlags(*verb, flags->prompt);
  AddGranularityFlags(*verb, flags->granularity);
  CLI::Option* add =
      verb->add_option("--add-to", flags->add_to, "Unite with the selection of this number")
          ->check(CLI::PositiveNumber);
  CLI::Option* subtract = verb->add_option("--subtract-from", flags->subtract_from,
                                           "Subtract from the selection of this number")
                              ->check(CLI::PositiveNumber)
                              ->excludes(add);
  verb->add_option("--intersect", flags->intersect, "Intersect with the selection of this number")
      ->check(CLI::PositiveNumber)
      ->excludes(add)
      ->excludes(subtract);
  verb->add_option("--views", flags->num_views, "Number of views that vote")
      ->check(CLI::Range(1, 100));
  verb->add_flag("--keep-disconnected", flags->keep_disconnected,
                 "Keep Gaussians that are not connected to what is clicked");
  AddSamClicksFlag(*verb, flags->sam_clicks);
  AddIndicesFlag(*verb, *what, flags->indices);
  verb->add_option("--name", flags->name, "Name of the selection, for people");
  verb->add_option("--out", flags->out, "Folder for STEM_selection.png");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunSelect(shell, *flags); }; });
}

void AddSelections(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<SelectionsFlags>();
  CLI::App* verb = app.add_subcommand("selections", "List a scene's selections, or describe one");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  CLI::Option* number = verb->add_option("NUMBER", flags->number, "Number of a selection")
                            ->check(CLI::PositiveNumber);
  CLI::Option* undo =
      verb->add_flag("--undo", flags->undo, "Describe the selection that it was made from")
          ->needs(number);
  verb->add_flag("--delete", flags->remove, "Delete the selection")->needs(number)->excludes(undo);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunSelections(shell, *flags); }; });
}

void AddCombine(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<CombineFlags>();
  CLI::App* verb =
      app.add_subcommand("combine", "Combine two selections of a model into a new one");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("FIRST", flags->first, "Number of the first selection")
      ->required()
      ->check(CLI::PositiveNumber);
  verb->add_option("OPERATION", flags->operation, "union, subtract or intersect")
      ->required()
      ->check(CLI::IsMember({"union", "subtract", "intersect"}));
  verb->add_option("SECOND", flags->second, "Number of the second selection")
      ->required()
      ->check(CLI::PositiveNumber);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunCombine(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
