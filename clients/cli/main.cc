// pepeseg: the command-line client of a pepeseg server.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <utility>

#include "clients/cli/completion.h"
#include "clients/cli/failure.h"
#include "clients/cli/meant_names.h"
#include "clients/cli/shell.h"

namespace {

using pepeseg::client::cli::Shell;

constexpr char kFooter[] = R"(Exit codes:
  0 done               1 unexpected fault       2 wrong command line
  3 not found          4 value or file refused  5 no server answers
  6 not now: it exists, a training is running, or there is no model yet
  7 the job failed     8 the job was cancelled  9 a limit of the server
 10 not permitted     11 corrupt bytes        130 interrupted; a job continues

`pepeseg VERB --help` lists the options of a verb.)";

// Ends the program; it calls only what is safe in a signal handler.
void LeaveOnInterrupt(int /*signal*/) {
  constexpr std::string_view kLine = "\ninterrupted; a running job continues: see `pepeseg jobs`\n";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, kLine.data(), kLine.size());
  _exit(pepeseg::client::cli::kInterrupted);
}

// Adds the verbs in the order in which --help lists them.
void AddVerbs(CLI::App& app, Shell& shell) {
  pepeseg::client::cli::AddScenes(app, shell);
  pepeseg::client::cli::AddDatasets(app, shell);
  pepeseg::client::cli::AddModels(app, shell);
  pepeseg::client::cli::AddUpload(app, shell);
  pepeseg::client::cli::AddEstimate(app, shell);
  pepeseg::client::cli::AddTrain(app, shell);
  pepeseg::client::cli::AddWatch(app, shell);
  pepeseg::client::cli::AddCancel(app, shell);
  pepeseg::client::cli::AddJobs(app, shell);
  pepeseg::client::cli::AddSegment(app, shell);
  pepeseg::client::cli::AddPropose(app, shell);
  pepeseg::client::cli::AddRender(app, shell);
  pepeseg::client::cli::AddPhotograph(app, shell);
  pepeseg::client::cli::AddLabel(app, shell);
  pepeseg::client::cli::AddLabels(app, shell);
  pepeseg::client::cli::AddSelect(app, shell);
  pepeseg::client::cli::AddSelections(app, shell);
  pepeseg::client::cli::AddCombine(app, shell);
  pepeseg::client::cli::AddDecompose(app, shell);
  pepeseg::client::cli::AddEvaluate(app, shell);
  pepeseg::client::cli::AddExport(app, shell);
  pepeseg::client::cli::AddResidents(app, shell);
  pepeseg::client::cli::AddKeys(app, shell);
  pepeseg::client::cli::AddQuota(app, shell);
  pepeseg::client::cli::AddTop(app, shell);
  pepeseg::client::cli::AddDrain(app, shell);
  pepeseg::client::cli::AddHealth(app, shell);
  pepeseg::client::cli::AddDemo(app, shell);
  pepeseg::client::cli::AddBench(app, shell);
  pepeseg::client::cli::AddBenchmark(app, shell);
  pepeseg::client::cli::AddCompletion(app, shell);
}

// Adds the options for the connection, which all verbs share.
void AddLogin(CLI::App& app, pepeseg::client::Login& login) {
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
pepeseg::client::cli::NamedModel NamedIn(const CLI::App& app) {
  pepeseg::client::cli::NamedModel named;
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
  auto channel = pepeseg::client::OpenChannel(shell.server, shell.login);
  if (!channel.ok()) return channel.status();
  shell.channel = *std::move(channel);
  return pepeseg::client::cli::WithNearestNames(pepeseg::client::Client(shell.channel),
                                                NamedIn(app), shell.verb());
}

// Parses the command line, runs the verb, and returns the exit code.
int Run(int argc, char** argv) {
  Shell shell;
  if (argc > 0 && argv[0] != nullptr) shell.program = argv[0];
  CLI::App app("Scenes from photographs, segments from clicks", "pepeseg");
  app.footer(kFooter);
  app.require_subcommand(1);
  app.fallthrough();  // options of the program may follow the verb
  app.add_option("--server", shell.server, "Address of the server, [https://]host:port")
      ->envname("PEPESEG_SERVER")
      ->capture_default_str();
  AddLogin(app, shell.login);
  app.add_flag("--json", shell.json, "Print JSON, one document a line, for scripts");
  app.set_version_flag("--version", "pepeseg " PEPESEG_VERSION, "Print the version and exit");
  AddVerbs(app, shell);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (app.exit(error) == 0) return pepeseg::client::cli::kSuccess;
    const std::string suggestion = pepeseg::client::cli::SuggestionFor(app, argc, argv);
    if (!suggestion.empty()) pepeseg::client::cli::Note(suggestion);
    return pepeseg::client::cli::kUsage;
  }

  const absl::Status status = RunVerb(app, shell);
  if (!status.ok()) {
    if (shell.json) pepeseg::client::cli::Print(pepeseg::client::cli::ExplainJson(status));
    pepeseg::client::cli::Note(pepeseg::client::cli::Explain(status, shell.server));
  }
  return pepeseg::client::cli::ExitCodeOf(status);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, LeaveOnInterrupt);
  try {
    return Run(argc, argv);
  } catch (const std::exception& error) {  // thrown while the parser is set up, or out of memory
    std::fprintf(stderr, "pepeseg: %s\n", error.what());
    return pepeseg::client::cli::kUnexpected;
  }
}
