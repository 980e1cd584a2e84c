#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "clients/cpp/client.h"
#include "clients/terminal/shell.h"
#include "pepeseg/v1/scene_service.pb.h"

// The description of a model that verbs print, and the command that they propose next.
namespace pepeseg::client::cli {

// Returns "poses given, masks embedded, depth none"; "" if the server does not report the sources.
std::string SourcesText(const v1::Model& model);

// Returns a metric of the model, such as "psnr"; 0 if it was not measured.
double MetricOf(const v1::Model& model, const std::string& name);

// Returns "mask quality 0.79: how far the masks of different views agree, 0 to 1"; "" if it was not
// measured.
std::string MaskQualityText(const v1::Model& model);

// Prints the server's advice on the model: one line for each reason why answers may be poor.
void PrintAdvice(const v1::Model& model);

// Returns the lines of a table of the scored held-out views and their mean; empty if no view was
// scored. Of more than 20 views it has the 20 with the lowest PSNR:
//   held-out view       PSNR    SSIM
//   frame-000000.jpg   21.46   0.799
//   mean of 2          21.65   0.803
std::vector<std::string> ScoreTable(std::span<const v1::View> views);

// Returns a command line of this program that can be pasted into a shell. The program is named as
// it was called. --server is there unless the environment or the default names the same server.
std::string CommandText(const Shell& shell, const std::vector<std::string>& words);

// Returns a command to try on a new model: a click in the middle of one of its views, or an export
// if the model has no features.
std::string FirstCommand(const Shell& shell, const v1::Model& model,
                         const std::vector<v1::View>& views);

// Prints what `model` was trained on, advice, the scores of its held-out views, and the command to
// type next.
absl::Status PrintTrained(const Shell& shell, const Client& client, const std::string& model);

}  // namespace pepeseg::client::cli
