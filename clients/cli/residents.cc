// The admin verbs about models in memory: "resident", "load", "unload" and "pin".
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/admin_verb.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {
namespace {

struct ResidentFlags {
  std::string admin;  // address of the admin listener
  std::string scene;
  std::string model = "live";
  bool off = false;  // unpin
};

using Stub = v1::AdminService::Stub;

// Returns the resource name of the model that the flags name.
std::string ModelOf(const ResidentFlags& flags) {
  return absl::StrCat(SceneName(flags.scene), "/models/", flags.model);
}

// Returns "host: 12.3 of 95.0 MiB reserved".
std::string UseLine(const char* kind, const v1::MemoryUse& use) {
  return absl::StrFormat("%s: %.1f of %.1f MiB reserved", kind, Mib(use.reserved_bytes()),
                         Mib(use.limit_bytes()));
}

// Returns a line of `pepeseg resident`: the name, host + device memory, and use of a model.
std::string ModelLine(const v1::ResidentModel& model) {
  return absl::StrFormat("%-40s %8.1f + %8.1f MiB  %d maps of %d rendered  %d in flight%s",
                         model.name(), Mib(model.host_bytes()), Mib(model.device_bytes()),
                         model.cached_maps(), model.num_renders(), model.queries_in_flight(),
                         model.pinned() ? "  pinned" : "");
}

absl::Status RunResident(const Shell& shell, const ResidentFlags& /*flags*/, Stub& admin) {
  v1::ListResidentModelsResponse answer;
  Call call("", kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.ListResidentModels(call, {}, &answer)));
  if (shell.json) {
    PrintJson(answer);
    return absl::OkStatus();
  }
  for (const v1::ResidentModel& model : answer.models()) Print(ModelLine(model));
  Print(UseLine("host", answer.host()));
  if (answer.has_device()) Print(UseLine("device", answer.device()));
  Print(absl::StrFormat("%d loaded, %d evicted since the server started", answer.num_loads(),
                        answer.num_evictions()));
  return absl::OkStatus();
}

void PrintModel(const Shell& shell, const v1::ResidentModel& model) {
  shell.json ? PrintJson(model) : Print(ModelLine(model));
}

absl::Status RunLoad(const Shell& shell, const ResidentFlags& flags, Stub& admin) {
  v1::LoadModelRequest request;
  request.set_name(ModelOf(flags));
  v1::ResidentModel answer;
  Call call(flags.scene, kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.LoadModel(call, request, &answer)));
  PrintModel(shell, answer);
  return absl::OkStatus();
}

absl::Status RunUnload(const Shell& /*shell*/, const ResidentFlags& flags, Stub& admin) {
  v1::UnloadModelRequest request;
  request.set_name(ModelOf(flags));
  google::protobuf::Empty answer;
  Call call(flags.scene, kCallSeconds);
  return FromGrpc(admin.UnloadModel(call, request, &answer));
}

absl::Status RunPin(const Shell& shell, const ResidentFlags& flags, Stub& admin) {
  v1::PinModelRequest pin;
  v1::UnpinModelRequest unpin;
  pin.set_name(ModelOf(flags));
  unpin.set_name(pin.name());
  v1::ResidentModel answer;
  Call call(flags.scene, kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(flags.off ? admin.UnpinModel(call, unpin, &answer)
                                     : admin.PinModel(call, pin, &answer)));
  PrintModel(shell, answer);
  return absl::OkStatus();
}

// Adds SCENE and --model.
void AddModelOptions(CLI::App& verb, ResidentFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--model", flags.model, "Number of the model; by default the live one");
}

}  // namespace

void AddResidents(CLI::App& app, Shell& shell) {
  const auto load = std::make_shared<ResidentFlags>(), unload = std::make_shared<ResidentFlags>(),
             pin = std::make_shared<ResidentFlags>();
  const auto add = [&](const VerbWords& words, const std::shared_ptr<ResidentFlags>& flags,
                       RunAdminVerb<ResidentFlags> run) -> CLI::App& {
    return AddAdminVerb<ResidentFlags>(app, shell, words, {flags, run});
  };
  add({"resident", "List the models in the server's memory"}, std::make_shared<ResidentFlags>(),
      RunResident);
  AddModelOptions(add({"load", "Load a model before its first query"}, load, RunLoad), *load);
  AddModelOptions(add({"unload", "Free the memory of a model"}, unload, RunUnload), *unload);
  CLI::App& pinning = add({"pin", "Keep a model in memory until it is unpinned"}, pin, RunPin);
  AddModelOptions(pinning, *pin);
  pinning.add_flag("--off", pin->off, "Unpin it, so that it can be evicted again");
}

}  // namespace pepeseg::client::cli
