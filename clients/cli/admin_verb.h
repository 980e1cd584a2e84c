#pragma once

#include <memory>

#include "absl/status/status.h"
#include "clients/cli/shell.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {

// What a verb of the admin listener does: `Flags` has the listener's address as `admin`.
template <typename Flags>
using RunAdminVerb = absl::Status (*)(const Shell&, const Flags&, v1::AdminService::Stub&);

struct VerbWords {
  const char* name;
  const char* description;
};

// A verb that speaks to a server's admin listener, not to --server.
template <typename Flags>
CLI::App& AddAdminVerb(CLI::App& app, Shell& shell, const VerbWords& words,
                       const std::pair<std::shared_ptr<Flags>, RunAdminVerb<Flags>>& what) {
  const auto& [flags, run] = what;
  CLI::App* added = app.add_subcommand(words.name, words.description);
  added
      ->add_option("--admin", flags->admin,
                   "Where the server's admin service listens, host:port or unix:path")
      ->envname("PEPESEG_ADMIN")
      ->required();
  added->callback([flags = flags, run = run, &shell] {
    shell.server = flags->admin;
    shell.verb = [&shell, flags, run] {
      return run(shell, *flags, *v1::AdminService::NewStub(shell.channel));
    };
  });
  return *added;
}

}  // namespace pepeseg::client::cli
