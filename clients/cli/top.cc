// What a server does just now, again and again: pools, jobs, models in memory. Asks its admin
// listener, as residents.cc does.
#include <unistd.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/top_screen.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {
namespace {

constexpr auto kPace = std::chrono::seconds(2);
constexpr double kTopSeconds = 10;

struct TopFlags {
  std::string admin;
  bool once = false;
};

absl::StatusOr<TopSnapshot> TakeSnapshot(v1::AdminService::Stub& admin) {
  TopSnapshot snapshot;
  Call status("", kTopSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.GetStatus(status, {}, &snapshot.status)));
  Call resident("", kTopSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.ListResident(resident, {}, &snapshot.resident)));
  return snapshot;
}

void Show(const Shell& shell, const TopSnapshot& snapshot) {
  if (shell.json) {
    Print(absl::StrCat("{\"status\":", ToJson(snapshot.status),
                       ",\"resident\":", ToJson(snapshot.resident), "}"));
    return;
  }
  constexpr char kClear[] = "\x1b[H\x1b[2J";
  std::string screen = isatty(STDOUT_FILENO) == 1 ? kClear : "";
  for (const std::string& line : TopLines(snapshot, absl::Now())) {
    absl::StrAppend(&screen, line, "\n");
  }
  Print(screen.substr(0, screen.size() - 1));
}

absl::Status RunTop(const Shell& shell, const TopFlags& flags) {
  const auto admin = v1::AdminService::NewStub(shell.channel);
  while (true) {
    ASSIGN_OR_RETURN(const TopSnapshot snapshot, TakeSnapshot(*admin));
    Show(shell, snapshot);
    if (flags.once) return absl::OkStatus();
    std::this_thread::sleep_for(kPace);
  }
}

struct DrainFlags {
  std::string admin;
  bool off = false;
};

absl::Status RunDrain(const Shell& shell, const DrainFlags& flags) {
  const auto admin = v1::AdminService::NewStub(shell.channel);
  v1::DrainRequest request;
  request.set_draining(!flags.off);
  TopSnapshot snapshot;
  Call call("", kTopSeconds);
  RETURN_IF_ERROR(FromGrpc(admin->Drain(call, request, &snapshot.status)));
  shell.json ? PrintJson(snapshot.status) : Print(TopLines(snapshot, absl::Now()).front());
  return absl::OkStatus();
}

void AddAdminOption(CLI::App& verb, std::string& admin) {
  verb.add_option("--admin", admin,
                  "Where the server's admin service listens, host:port or unix:path")
      ->envname("PEPESEG_ADMIN")
      ->required();
}

}  // namespace

void AddTop(CLI::App& app, Shell& shell) {
  const auto flags = std::make_shared<TopFlags>();
  CLI::App* verb = app.add_subcommand("top", "Show what a server does, every two seconds");
  AddAdminOption(*verb, flags->admin);
  verb->add_flag("--once", flags->once, "One look only");
  verb->callback([flags, &shell] {
    shell.server = flags->admin;  // so that it is spoken to, and failures name it
    shell.verb = [flags, &shell] { return RunTop(shell, *flags); };
  });
}

void AddDrain(CLI::App& app, Shell& shell) {
  const auto flags = std::make_shared<DrainFlags>();
  CLI::App* verb = app.add_subcommand("drain", "Let a server take nothing new, before it stops");
  AddAdminOption(*verb, flags->admin);
  verb->add_flag("--off", flags->off, "Take that back");
  verb->callback([flags, &shell] {
    shell.server = flags->admin;
    shell.verb = [flags, &shell] { return RunDrain(shell, *flags); };
  });
}

}  // namespace pepeseg::client::cli
