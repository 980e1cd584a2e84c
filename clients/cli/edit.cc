// The verb "edit": a new model by one edit of Gaussians.
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {
namespace {

constexpr char kHexDigits[] = "0123456789abcdefABCDEF";

struct EditFlags {
  PromptFlags prompt;  // with the scene and the model
  SubsetFlags subset;  // empty: the prompt is selected first
  std::string edit;    // "remove", "keep", "move", "copy" or "recolor"
  bool fill = false;   // of remove
  std::string by;      // of move and copy, as are the next three; empty: not given
  std::string rotation, about;
  double scale = 0;     // 0: not given
  std::string color;    // of recolor
  double strength = 0;  // of recolor; 0: not given
};

bool IsMove(const EditFlags& flags) { return flags.edit == "move" || flags.edit == "copy"; }

// Returns the numbers of "1,2.5,-3"; empty: it is something else.
std::vector<double> NumbersOf(const std::string& text) {
  std::vector<double> numbers;
  for (const absl::string_view part : absl::StrSplit(text, ',')) {
    double number = 0;
    if (!absl::SimpleAtod(part, &number) || !std::isfinite(number)) return {};
    numbers.push_back(number);
  }
  return numbers;
}

absl::StatusOr<v1::Vector3> ParseVector(const std::string& flag, const std::string& text) {
  const std::vector<double> numbers = NumbersOf(text);
  if (numbers.size() != 3) {
    return absl::InvalidArgumentError(
        absl::StrCat(flag, " \"", text, "\": expected X,Y,Z in scene units, such as 0.1,0,-0.25"));
  }
  v1::Vector3 vector;
  vector.set_x(numbers[0]), vector.set_y(numbers[1]), vector.set_z(numbers[2]);
  return vector;
}

// Reads an axis and an angle, or a quaternion W,X,Y,Z, which is normalised.
absl::StatusOr<v1::Quaternion> ParseRotation(const std::string& text) {
  v1::Quaternion rotation;
  if (const size_t comma = text.find(','); comma == 1 && text.find_first_of("xyz") == 0) {
    const std::vector<double> degrees = NumbersOf(text.substr(2));
    if (degrees.size() == 1) {
      const double half = degrees[0] * std::numbers::pi / 360;
      rotation.set_w(std::cos(half));
      if (text[0] == 'x') rotation.set_x(std::sin(half));
      if (text[0] == 'y') rotation.set_y(std::sin(half));
      if (text[0] == 'z') rotation.set_z(std::sin(half));
      return rotation;
    }
  }
  const std::vector<double> q = NumbersOf(text);
  const double norm =
      q.size() == 4 ? std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) : 0;
  if (!(norm > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--rotate \"", text,
                     "\": expected an axis and degrees, such as y,90, or a quaternion W,X,Y,Z"));
  }
  rotation.set_w(q[0] / norm), rotation.set_x(q[1] / norm);
  rotation.set_y(q[2] / norm), rotation.set_z(q[3] / norm);
  return rotation;
}

absl::Status SetMove(const EditFlags& flags, v1::EditModelRequest::Move& move) {
  if (flags.by.empty() && flags.rotation.empty() && flags.scale == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        flags.edit, " needs --by, --rotate or --scale: where to, how turned, how large"));
  }
  if (!flags.by.empty()) {
    ASSIGN_OR_RETURN(*move.mutable_translation(), ParseVector("--by", flags.by));
  }
  if (!flags.about.empty()) {
    ASSIGN_OR_RETURN(*move.mutable_pivot(), ParseVector("--about", flags.about));
  }
  if (!flags.rotation.empty()) {
    ASSIGN_OR_RETURN(*move.mutable_rotation(), ParseRotation(flags.rotation));
  }
  move.set_scale(flags.scale);
  move.set_copy(flags.edit == "copy");
  return absl::OkStatus();
}

absl::Status SetRecolor(const EditFlags& flags, v1::EditModelRequest::Recolor& recolor) {
  const std::string digits = flags.color.substr(absl::StartsWith(flags.color, "#") ? 1 : 0);
  uint32_t rgb = 0;
  if (digits.size() != 6 || digits.find_first_not_of(kHexDigits) != std::string::npos ||
      !absl::SimpleHexAtoi(digits, &rgb)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--color \"", flags.color, "\": expected \"#rrggbb\", such as \"#cc2200\""));
  }
  recolor.set_red((rgb >> 16 & 255) / 255.0);
  recolor.set_green((rgb >> 8 & 255) / 255.0);
  recolor.set_blue((rgb & 255) / 255.0);
  recolor.set_strength(flags.strength);
  return absl::OkStatus();
}

// Returns INVALID_ARGUMENT for a flag that the edit does not have.
absl::Status CheckFlags(const EditFlags& flags) {
  std::string wrong;
  const auto check = [&wrong](const char* flag, bool is_given, bool is_its) {
    if (is_given && !is_its && wrong.empty()) wrong = flag;
  };
  check("--fill", flags.fill, flags.edit == "remove");
  check("--by", !flags.by.empty(), IsMove(flags));
  check("--rotate", !flags.rotation.empty(), IsMove(flags));
  check("--scale", flags.scale != 0, IsMove(flags));
  check("--about", !flags.about.empty(), IsMove(flags));
  check("--color", !flags.color.empty(), flags.edit == "recolor");
  check("--strength", flags.strength != 0, flags.edit == "recolor");
  if (wrong.empty()) return absl::OkStatus();
  const char* const whose = wrong == "--fill"                             ? "remove"
                            : wrong == "--color" || wrong == "--strength" ? "recolor"
                                                                          : "move and copy";
  return absl::InvalidArgumentError(absl::StrCat(wrong, " is of ", whose, ", not of ", flags.edit));
}

// Sets what is done with the Gaussians.
absl::Status SetEdit(const EditFlags& flags, v1::EditModelRequest& request) {
  RETURN_IF_ERROR(CheckFlags(flags));
  if (IsMove(flags)) return SetMove(flags, *request.mutable_move());
  if (flags.edit == "recolor") return SetRecolor(flags, *request.mutable_recolor());
  if (flags.fill && flags.subset.without) {
    return absl::InvalidArgumentError(
        "--fill continues what is around a thing: leave out --without");
  }
  request.mutable_remove()->set_fill(flags.fill);
  return absl::OkStatus();
}

// Selects what the prompt means, and names the selection and its model in the request.
absl::Status SelectFirst(const Client& client, const EditFlags& flags,
                         v1::EditModelRequest& request) {
  v1::CreateSelectionRequest wanted;
  wanted.set_model(request.model());
  ASSIGN_OR_RETURN(*wanted.mutable_prompt(), ParsePrompt(flags.prompt));
  wanted.set_frame(flags.prompt.frame);
  ASSIGN_OR_RETURN(const v1::Selection selection, client.Select(std::move(wanted)));
  if (selection.num_gaussians() == 0) {
    return absl::InvalidArgumentError(
        "the prompt selects no Gaussians; try another, or `pepeseg select` and --selection");
  }
  Note(absl::StrFormat("selected: %s  %d Gaussians", selection.name(), selection.num_gaussians()));
  request.set_model(selection.model());
  request.mutable_subset()->set_selection(selection.name());
  return absl::OkStatus();
}

// Prints "scenes/shelf/models/2  edited from scenes/shelf/models/1: removed 1204, added 310
// Gaussians", and the selection of the last ones.
void PrintResult(const EditFlags& flags, const v1::EditModelResponse::Result& result) {
  std::vector<std::string> parts;
  const char* last = "";
  const auto add = [&](const char* done, int64_t count) {
    if (count == 0) return;
    parts.push_back(absl::StrCat(done, " ", count));
    last = done;
  };
  add("removed", result.num_removed());
  add(IsMove(flags) ? "moved" : "recoloured", result.num_changed());
  add("added", result.num_added());
  Print(absl::StrFormat("%s  edited from %s: %s Gaussians", result.model(), result.edited_from(),
                        absl::StrJoin(parts, ", ")));
  if (!result.selection().empty()) {
    Print(absl::StrCat("  the ", last, " ones are in ", result.selection()));
  }
}

absl::StatusOr<v1::EditModelResponse::Result> EditWithProgress(
    const Client& client, const v1::EditModelRequest& request) {
  ProgressLine line;
  return client.Edit(request, [&line](const v1::EditModelResponse::Progress& progress) {
    line.Show(progress.num_all() == 0 ? progress.activity()
                                      : absl::StrFormat("%s: %d of %d", progress.activity(),
                                                        progress.num_done(), progress.num_all()));
  });
}

absl::Status RunEdit(const Shell& shell, const EditFlags& flags) {
  v1::EditModelRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  RETURN_IF_ERROR(SetEdit(flags, request));
  const Client client(shell.channel);
  SubsetFlags named = flags.subset;
  named.without = false;
  ASSIGN_OR_RETURN(*request.mutable_subset(), ParseSubset(named, flags.prompt.scene));
  if (request.subset().of_case() == v1::Subset::OF_NOT_SET) {
    RETURN_IF_ERROR(SelectFirst(client, flags, request));
  }
  // What is kept is what is not removed.
  request.mutable_subset()->set_complement(flags.subset.without != (flags.edit == "keep"));
  ASSIGN_OR_RETURN(const v1::EditModelResponse::Result result, EditWithProgress(client, request));
  shell.json ? PrintJson(result) : PrintResult(flags, result);
  Note(absl::StrCat("undo: pepeseg models ", flags.prompt.scene, " ",
                    result.edited_from().substr(result.edited_from().rfind('/') + 1), " --live"));
  return absl::OkStatus();
}

void AddMoveFlags(CLI::App& verb, EditFlags& flags) {
  verb.add_option("--by", flags.by, "move, copy: how far along the axes of the scene, scene units")
      ->type_name("X,Y,Z");
  verb.add_option(
          "--rotate", flags.rotation,
          "move, copy: x, y or z, and degrees, counter-clockwise as the axis points at you; "
          "or a quaternion W,X,Y,Z")
      ->type_name("AXIS,DEGREES");
  verb.add_option("--scale", flags.scale, "move, copy: how much larger")
      ->check(CLI::Range(0.001, 1000.0));
  verb.add_option(
          "--about", flags.about,
          "move, copy: the point that rotation and scale keep; by default the middle of the "
          "Gaussians' box")
      ->type_name("X,Y,Z");
}

}  // namespace

void AddEdit(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<EditFlags>();
  CLI::App* verb = app.add_subcommand("edit",
                                      "Edit Gaussians, which makes a new model: remove a thing and "
                                      "fill the hole, crop the scene to "
                                      "one, move, copy or recolour it");
  CLI::Option_group* what = AddPromptFlags(*verb, flags->prompt);
  verb->add_option("EDIT", flags->edit, "remove, keep (remove all else), move, copy or recolor")
      ->required()
      ->check(CLI::IsMember({"remove", "keep", "move", "copy", "recolor"}));
  AddSubsetFlags(*verb, flags->subset, what);
  verb->add_flag("--fill", flags->fill,
                 "remove: continue the surroundings where no photograph shows them, and light the "
                 "shadow; some seconds");
  AddMoveFlags(*verb, *flags);
  verb->add_option("--color", flags->color, "recolor: \"#rrggbb\"; light and dark stay");
  verb->add_option("--strength", flags->strength, "recolor: share of the new colour; by default 1")
      ->check(CLI::Range(0.001, 1.0));
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunEdit(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
