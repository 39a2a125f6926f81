/// \file
/// Several estimates in one table: text, Markdown, LaTeX, CSV.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "errors.hpp"

namespace eval {

/// How numbers and names look in one kind of table.
enum class TableFormat { Text, Markdown, Latex, Csv };
[[nodiscard]] constexpr std::array<const char*, 4> enum_names(TableFormat) { return {"text", "markdown", "latex", "csv"}; }

inline std::string number(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

/// (baseline - value) / baseline in percent: positive is better.
inline double improvement(double baseline, double value) { return 100 * (baseline - value) / baseline; }

inline std::string latex_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') out += "\\textbackslash{}";
    else if (c == '~') out += "\\textasciitilde{}";
    else if (c == '^') out += "\\textasciicircum{}";
    else if (std::string("&%$#_{}").find(c) != std::string::npos) out += std::string("\\") + c;
    else out += std::iscntrl(static_cast<unsigned char>(c)) != 0 ? '?' : c;
  }
  return out;
}
inline std::string markdown_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (std::string("\\|*_`<>[]").find(c) != std::string::npos) out += '\\';
    out += std::iscntrl(static_cast<unsigned char>(c)) != 0 ? '?' : c;
  }
  return out;
}
inline std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + "\"";
}

/// One kind of error: its rmse, standard deviation and improvement are three columns.
struct Measure {
  std::string name;
  const apso::Statistics& (*of)(const Errors&);
  bool relative_first = false;  ///< the number of its pairs stands before it
};
inline std::vector<Measure> measures(const Rules& rules) {
  return {{"ATE [m]", [](const Errors& e) -> const apso::Statistics& { return e.ate.statistics; }},
          {"RPE " + rules.delta + " [m]", [](const Errors& e) -> const apso::Statistics& { return e.rpe.translation; }, true},
          {"RPE " + rules.delta + " [deg]", [](const Errors& e) -> const apso::Statistics& { return e.rpe.rotation_deg; }}};
}

/// What a table of several estimates says of how it was made.
inline std::vector<std::string> table_notes(const std::vector<Errors>& all, std::size_t baseline, const Rules& rules) {
  std::vector<std::string> notes{"association: " + association_text(rules), "alignment: " + alignment_text(rules.ate),
                                 "RPE over " + rules.delta + ", form " + form_text(rules.rpe)};
  if (all.size() > 1) {
    notes.push_back("improvement: (baseline - value) / baseline of the rmse, baseline " + all[baseline].estimate.name);
  }
  if (std::any_of(all.begin(), all.end(), [](const Errors& e) { return e.share() < enough_pairs; })) {
    notes.emplace_back("!: less than 90 % of the poses have an error; such a row is not the best of a column");
  }
  return notes;
}

/// Rows of cells, the best of each column marked.
class Table {
 public:
  struct Cell {
    std::string text;
    bool best = false;
  };
  Table(const std::vector<Errors>& all, std::size_t baseline, const Rules& rules, int digits) : notes_(table_notes(all, baseline, rules)) {
    const bool several = all.size() > 1;
    const bool scaled = rules.ate.alignment == apso::TrajectoryAlignment::Sim3;
    head_ = {"estimate", "pairs"};
    if (scaled) head_.emplace_back("scale");
    for (const Measure& m : measures(rules)) {
      if (m.relative_first) head_.emplace_back("RPE pairs");
      head_.push_back(m.name + " rmse");
      head_.emplace_back("S.D.");
      if (several) head_.emplace_back("improvement [%]");
    }
    const bool any_whole = std::any_of(all.begin(), all.end(), [](const Errors& e) { return e.share() >= enough_pairs; });
    const auto best = [&](const Measure& m, double apso::Statistics::*field) {
      double least = -1;
      for (const Errors& e : all) {
        if ((any_whole && e.share() < enough_pairs) || m.of(e).count == 0) continue;
        if (least < 0 || m.of(e).*field < least) least = m.of(e).*field;
      }
      return least;
    };
    for (const Errors& e : all) {
      const bool part = e.share() < enough_pairs;
      std::vector<Cell> row{{e.estimate.name},
                            {std::to_string(e.ate.pairs.size()) + " of " + std::to_string(e.possible) + " (" + number(100 * e.share(), 1) +
                             " %)" + (part ? " !" : "")}};
      if (scaled) row.push_back({number(e.ate.scale, digits)});
      for (const Measure& m : measures(rules)) {
        const apso::Statistics& s = m.of(e);
        if (m.relative_first) row.push_back({std::to_string(e.rpe.pairs.size())});
        const auto cell = [&](double apso::Statistics::*field) {
          if (s.count == 0) return Cell{"-"};
          return Cell{number(s.*field, digits), several && !(any_whole && part) && s.*field == best(m, field)};
        };
        row.push_back(cell(&apso::Statistics::rmse));
        row.push_back(cell(&apso::Statistics::std));
        if (!several) continue;
        const apso::Statistics& reference = m.of(all[baseline]);
        const bool known = &e != &all[baseline] && s.count > 0 && reference.count > 0 && reference.rmse > 0;
        row.push_back({known ? number(improvement(reference.rmse, s.rmse), 2) : "-"});
      }
      rows_.push_back(std::move(row));
    }
  }

  [[nodiscard]] std::string text() const {
    std::vector<std::size_t> width(head_.size(), 0);
    const auto shown = [](const Cell& c) { return c.text + (c.best ? "*" : ""); };
    for (std::size_t i = 0; i < head_.size(); ++i) {
      width[i] = head_[i].size();
      for (const auto& row : rows_) width[i] = std::max(width[i], shown(row[i]).size());
    }
    std::string out;
    const auto line = [&](auto&& cell) {
      for (std::size_t i = 0; i < head_.size(); ++i) {
        const std::string t = cell(i);
        const std::string space(width[i] - t.size(), ' ');
        out += (i > 0 ? "  " : "") + (i == 0 ? t + space : space + t);
      }
      out += '\n';
    };
    line([&](std::size_t i) { return head_[i]; });
    for (const auto& row : rows_) line([&](std::size_t i) { return shown(row[i]); });
    for (const std::string& n : notes_) out += n + "\n";
    return rows_.size() > 1 ? out + "*: best of the column\n" : out;
  }
  [[nodiscard]] std::string markdown() const {
    std::string out = "|";
    for (const std::string& h : head_) out += " " + markdown_text(h) + " |";
    out += "\n|";
    for (std::size_t i = 0; i < head_.size(); ++i) out += i == 0 ? "---|" : "---:|";
    out += '\n';
    for (const auto& row : rows_) {
      out += '|';
      for (const Cell& c : row) out += c.best ? " **" + markdown_text(c.text) + "** |" : " " + markdown_text(c.text) + " |";
      out += '\n';
    }
    for (const std::string& n : notes_) out += "\n- " + markdown_text(n);
    return out + "\n";
  }
  [[nodiscard]] std::string latex() const {
    std::string out = "% needs \\usepackage{booktabs}\n";
    for (const std::string& n : notes_) out += "% " + n + "\n";
    out += "\\begin{tabular}{l" + std::string(head_.size() - 1, 'r') + "}\n\\toprule\n";
    for (std::size_t i = 0; i < head_.size(); ++i) out += (i > 0 ? " & " : "") + latex_text(head_[i]);
    out += " \\\\\n\\midrule\n";
    for (const auto& row : rows_) {
      for (std::size_t i = 0; i < row.size(); ++i) {
        const std::string t = latex_text(row[i].text);
        out += (i > 0 ? " & " : "") + (row[i].best ? "\\textbf{" + t + "}" : t);
      }
      out += " \\\\\n";
    }
    return out + "\\bottomrule\n\\end{tabular}\n";
  }

 private:
  std::vector<std::string> head_;
  std::vector<std::vector<Cell>> rows_;
  std::vector<std::string> notes_;
};

/// All numbers of all estimates, one line each, for other programs.
inline std::string csv(const std::vector<Errors>& all, std::size_t baseline, const Rules& rules) {
  std::string out = "name,file,format,poses,pairs,pairs_possible,alignment,scale,association,max_difference_s";
  const char* const names[] = {"ate_m", "rpe_translation_m", "rpe_rotation_deg"};
  for (const char* n : names) {
    if (n == names[1]) out += ",rpe_delta,rpe_form,rpe_pairs";
    for (const char* s : {"rmse", "mean", "median", "std", "min", "max", "improvement_percent"}) out += "," + std::string(n) + "_" + s;
  }
  out += '\n';
  const auto exact = [](double v) {
    char text[40];
    std::snprintf(text, sizeof text, "%.9g", v);
    return std::string(text);
  };
  for (const Errors& e : all) {
    out += csv_text(e.estimate.name) + "," + csv_text(e.estimate.path) + "," + enum_name(e.estimate.file.format) + "," +
           std::to_string(e.estimate.trajectory().size()) + "," + std::to_string(e.ate.pairs.size()) + "," + std::to_string(e.possible) +
           "," + enum_name(rules.ate.alignment) + "," + exact(e.ate.scale) + "," + enum_name(rules.ate.association) + "," +
           exact(limit_of(rules.ate));
    for (const Measure& m : measures(rules)) {
      const apso::Statistics& s = m.of(e);
      if (m.relative_first) out += "," + rules.delta + "," + enum_name(rules.rpe.form) + "," + std::to_string(e.rpe.pairs.size());
      for (double v : {s.rmse, s.mean, s.median, s.std, s.min, s.max}) out += "," + (s.count > 0 ? exact(v) : std::string());
      const apso::Statistics& reference = m.of(all[baseline]);
      const bool known = &e != &all[baseline] && s.count > 0 && reference.count > 0 && reference.rmse > 0;
      out += "," + (known ? exact(improvement(reference.rmse, s.rmse)) : std::string());
    }
    out += '\n';
  }
  return out;
}

}  // namespace eval
