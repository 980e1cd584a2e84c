#pragma once

#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "clients/terminal/shell.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

// Verbs that call the AdminService. A server offers it on a listener of its own, whose address is
// given by --admin or PEPESEG_ADMIN; --server is ignored.
namespace pepeseg::client::cli {

// Runs an admin verb. `Flags` is a struct with a member `std::string admin`, the address.
template <typename Flags>
using RunAdminVerb = absl::Status (*)(const Shell&, const Flags&, v1::AdminService::Stub&);

struct VerbWords {
  const char* name;
  const char* description;
};

// Adds a verb with --admin and returns it, so that more options can be added. `what` has the flags,
// which are filled by parsing, and the function that runs the verb with them.
template <typename Flags>
CLI::App& AddAdminVerb(CLI::App& app, Shell& shell, const VerbWords& words,
                       const std::pair<std::shared_ptr<Flags>, RunAdminVerb<Flags>>& what) {
  const auto& [flags, run] = what;
  CLI::App* added = app.add_subcommand(words.name, words.description);
  added
      ->add_option("--admin", flags->admin,
                   "Address of the server's admin service, host:port or unix:path")
      ->envname("PEPESEG_ADMIN")
      ->required();
  added->callback([flags = flags, run = run, &shell] {
    shell.server = flags->admin;  // so that the channel goes there and errors name it
    shell.verb = [&shell, flags, run] {
      return run(shell, *flags, *v1::AdminService::NewStub(shell.channel));
    };
  });
  return *added;
}

}  // namespace pepeseg::client::cli
