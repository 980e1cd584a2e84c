#include "clients/terminal/program.h"

#include <malloc.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "clients/terminal/failure.h"
#include "clients/terminal/meant_names.h"
#include "clients/terminal/suggestion.h"

namespace pepeseg::client::cli {
namespace {

constexpr char kFooter[] = R"(Exit codes:
  0 done               1 unexpected fault       2 wrong command line
  3 not found          4 value or file refused  5 no server answers
  6 not now: it exists, a training is running, or there is no model yet
  7 the job failed     8 the job was cancelled  9 a limit of the server
 10 not permitted     11 corrupt bytes        130 interrupted; a job continues

`VERB --help` lists the options of a verb.)";

// Ends the program; it calls only what is safe in a signal handler.
void LeaveOnInterrupt(int /*signal*/) {
  constexpr std::string_view kLine = "\ninterrupted; a running job continues: see `pepeseg jobs`\n";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, kLine.data(), kLine.size());
  _exit(kInterrupted);
}

// Makes the allocator keep what is freed, since the program ends soon: pictures get their pages
// from the kernel once, a tenth of the time of a click at a megapixel.
void KeepFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
}

// Adds the options for the connection, which all verbs share.
void AddLogin(CLI::App& app, Login& login) {
  app.add_option("--key-file", login.key_file,
                 "File with the API key, or the token (JWT), that the server or its gateway "
                 "demands; by default the value of PEPESEG_KEY")
      ->type_name("FILE");
  app.add_flag("--tls", login.tls, "Encrypt the connection, as with https://");
  app.add_option("--ca", login.ca,
                 "PEM with the authorities trusted to sign the server's certificate; by default "
                 "those of the system")
      ->envname("PEPESEG_CA")
      ->type_name("FILE");
  app.add_option("--certificate", login.certificate,
                 "PEM with the certificate of this client, if the server demands one")
      ->envname("PEPESEG_CERTIFICATE")
      ->type_name("FILE");
  app.add_option("--certificate-key", login.certificate_key,
                 "PEM with the private key of --certificate")
      ->envname("PEPESEG_CERTIFICATE_KEY")
      ->type_name("FILE");
}

// Returns the scene and model that the options of the parsed verb name.
NamedModel NamedIn(const CLI::App& app) {
  NamedModel named;
  for (const CLI::App* verb : app.get_subcommands()) {
    for (const auto& [name, value] :
         {std::pair("SCENE", &named.scene), {"--model", &named.model}}) {
      const CLI::Option* option = verb->get_option_no_throw(name);
      if (option != nullptr && option->count() > 0) *value = option->results().front();
    }
  }
  return named;
}

// Opens the channel and runs the chosen verb.
absl::Status RunVerb(const CLI::App& app, Shell& shell) {
  auto channel = OpenChannel(shell.server, shell.login);
  if (!channel.ok()) return channel.status();
  shell.channel = *std::move(channel);
  return WithNearestNames(Client(shell.channel), NamedIn(app), shell.verb());
}

// Returns the name or path of `pepeseg`: next to this program if it was called by a path.
std::string PepesegNextTo(const char* program) {
  return std::filesystem::path(program).replace_filename("pepeseg").string();
}

// Parses the command line, runs the verb, and returns the exit code.
int Run(const Program& program, int argc, char** argv) {
  Shell shell;
  if (argc > 0 && argv[0] != nullptr) shell.program = PepesegNextTo(argv[0]);
  CLI::App app(program.description, program.name);
  app.footer(kFooter);
  app.require_subcommand(1);
  app.fallthrough();  // options of the program may follow the verb
  app.add_option("--server", shell.server, "Address of the server, [https://]host:port")
      ->envname("PEPESEG_SERVER")
      ->capture_default_str();
  AddLogin(app, shell.login);
  app.add_flag("--json", shell.json, "Print JSON, one document a line, for scripts");
  app.set_version_flag("--version", program.name + " " PEPESEG_VERSION,
                       "Print the version and exit");
  program.add_verbs(app, shell);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (app.exit(error) == 0) return kSuccess;
    const std::string suggestion = SuggestionFor(app, argc, argv);
    if (!suggestion.empty()) Note(suggestion);
    return kUsage;
  }

  const absl::Status status = RunVerb(app, shell);
  if (!status.ok()) {
    if (shell.json) Print(ExplainJson(status));
    Note(Explain(status, shell.server));
  }
  return ExitCodeOf(status);
}

}  // namespace

int RunProgram(const Program& program, int argc, char** argv) {
  std::signal(SIGINT, LeaveOnInterrupt);
  KeepFreedMemory();
  try {
    return Run(program, argc, argv);
  } catch (const std::exception& error) {  // thrown while the parser is set up, or out of memory
    std::fprintf(stderr, "%s: %s\n", program.name.c_str(), error.what());
    return kUnexpected;
  }
}

}  // namespace pepeseg::client::cli
