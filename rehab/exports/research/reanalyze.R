# Redo the differences of a closed study from its folder of an export, in R alone, without packages.
# Rscript reanalyze.R FOLDER. It shares no code with GARRY: the same model, written again.
# Ends with 1 where a number differs from differences.csv by more than 1e-6 of itself.

folder <- c(commandArgs(trailingOnly = TRUE), ".")[1]
read <- function(name) {
  read.csv(file.path(folder, name), colClasses = "character", check.names = FALSE, encoding = "UTF-8")
}
number <- function(text) suppressWarnings(as.numeric(text)) # an empty cell becomes NA

pinv <- function(m) {
  s <- svd(m)
  keep <- s$d > max(dim(m)) * 1e-13 * max(s$d, 1e-300)
  if (!any(keep)) return(t(m) * 0)
  s$v[, keep, drop = FALSE] %*% (t(s$u[, keep, drop = FALSE]) / s$d[keep])
}
trace <- function(a, b) sum(a * t(b))
total <- function(units, f) Reduce(`+`, lapply(units, f))

# Restricted maximum likelihood, Kenward and Roger's covariance by the observed information. A unit
# is a person: x (visits, effects), y, and parts: what each variance adds to the visits' covariance.
round_of <- function(units, variances) {
  ways <- lapply(units, function(u) {
    w <- solve(Reduce(`+`, Map(`*`, u$parts, variances)))
    list(w = w, wp = lapply(u$parts, function(p) w %*% p), xw = t(u$x) %*% w)
  })
  each <- seq_along(units)
  v <- seq_along(variances)
  plain <- pinv(total(each, function(i) ways[[i]]$xw %*% units[[i]]$x))
  effects <- plain %*% total(each, function(i) ways[[i]]$xw %*% units[[i]]$y)
  slopes <- lapply(v, function(k) total(each, function(i) {
    ways[[i]]$xw %*% units[[i]]$parts[[k]] %*% t(ways[[i]]$xw)
  }))
  errors <- lapply(each, function(i) {
    ways[[i]]$w %*% (units[[i]]$y - units[[i]]$x %*% effects)
  })
  pulled <- lapply(each, function(i) sapply(units[[i]]$parts, function(p) p %*% errors[[i]]))
  pulled <- lapply(each, function(i) matrix(pulled[[i]], length(errors[[i]])))
  squares <- as.vector(total(each, function(i) t(errors[[i]]) %*% pulled[[i]]))
  crossed <- total(each, function(i) ways[[i]]$xw %*% pulled[[i]])
  curved <- total(each, function(i) t(pulled[[i]]) %*% ways[[i]]$w %*% pulled[[i]])
  curved <- curved - t(crossed) %*% plain %*% crossed
  pair <- function(k, l) total(each, function(i) {
    ways[[i]]$xw %*% units[[i]]$parts[[k]] %*% ways[[i]]$wp[[l]] %*% ways[[i]]$w %*% units[[i]]$x
  })
  pairs <- lapply(v, function(k) lapply(v, function(l) pair(k, l)))
  information <- outer(v, v, Vectorize(function(k, l) {
    first <- sum(sapply(ways, function(way) trace(way$wp[[k]], way$wp[[l]])))
    twice <- trace(plain %*% slopes[[k]], plain %*% slopes[[l]])
    (first - 2 * trace(plain, pairs[[k]][[l]]) + twice) / 2
  }))
  observed <- curved - information
  ends <- range(eigen(observed, symmetric = TRUE, only.values = TRUE)$values)
  list(plain = plain, effects = effects, slopes = slopes, squares = squares,
       information = information, moves = plain %*% crossed,
       observed = if (ends[1] < 1e-3 * ends[2]) curved / 2 else observed)
}

fit <- function(units, diagonal) {
  x <- do.call(rbind, lapply(units, `[[`, "x"))
  y <- unlist(lapply(units, `[[`, "y"))
  off <- function(p) any(p[row(p) != col(p)] != 0)
  used <- sapply(seq_along(diagonal), function(k) {
    if (diagonal[k]) any(sapply(units, function(u) any(u$parts[[k]] != 0)))
    else any(sapply(units, function(u) off(u$parts[[k]])))
  })
  units <- lapply(units, function(u) { u$parts <- u$parts[used]; u })
  freedom <- length(y) - qr(x)$rank
  least <- sum((y - x %*% (pinv(x) %*% y))^2) / freedom
  variances <- ifelse(diagonal[used], least, 0)
  smallest <- function(at) min(sapply(units, function(u) {
    min(eigen(Reduce(`+`, Map(`*`, u$parts, at)), symmetric = TRUE, only.values = TRUE)$values)
  }))
  for (turn in 1:200) {
    now <- round_of(units, variances)
    target <- as.vector(pinv(now$information) %*% (now$squares / 2))
    step <- 1
    while (smallest(variances + step * (target - variances)) < 1e-7 * least && step > 1e-12) {
      step <- step / 2
    }
    moved <- variances + step * (target - variances)
    change <- max(abs(moved - variances)) / least
    variances <- moved
    if (change < 1e-9) break
  }
  now <- round_of(units, variances)
  of_variances <- pinv(now$observed)
  list(effects = now$effects, plain = now$plain, freedom = freedom, of_variances = of_variances,
       adjusted = now$plain + 2 * now$moves %*% of_variances %*% t(now$moves),
       slopes = lapply(now$slopes, function(s) now$plain %*% s %*% now$plain))
}

estimate <- function(model, weights) {
  value <- sum(weights * model$effects)
  plain <- drop(t(weights) %*% model$plain %*% weights)
  slopes <- sapply(model$slopes, function(s) drop(t(weights) %*% s %*% weights)) / plain
  spread <- drop(t(slopes) %*% model$of_variances %*% slopes)
  freedom <- if (spread > 0) min(2 / spread, model$freedom) else model$freedom
  error <- sqrt(max(plain, drop(t(weights) %*% model$adjusted %*% weights)))
  half <- qt(0.975, freedom) * error
  c(difference = value, low_95 = value - half, high_95 = value + half,
    p = 2 * pt(-abs(value) / error, freedom))
}

indicator <- function(of, is) as.numeric(of == is)

# Rows of one outcome; arms in their order. Returns the model and the weights of each arm's mean.
model_of <- function(rows, arms, crossover) {
  rows$value <- number(rows$value)
  rows <- rows[!is.na(rows$value), ]
  visits <- sort(unique(as.integer(rows$visit)))
  visit <- match(as.integer(rows$visit), visits)
  people <- split(seq_len(nrow(rows)), factor(rows$participant, unique(rows$participant)))
  same <- function(by) lapply(people, function(i) outer(by[i], by[i], `==`) * 1)
  own <- same(seq_len(nrow(rows)))
  alike <- same(rows$participant)
  if (crossover) {
    last <- length(visits)
    of_visit <- sapply(seq_len(last - 1), function(k) indicator(visit, k) - indicator(visit, last))
    x <- cbind(sapply(arms, function(a) indicator(rows$arm, a)), matrix(of_visit, nrow(rows)))
    parts <- list(own, alike, same(rows$period))
    diagonal <- c(TRUE, FALSE, FALSE)
    weights <- lapply(seq_along(arms), function(k) indicator(seq_len(ncol(x)), k))
  } else {
    cell <- paste(rows$arm, visit)
    cells <- unique(cell)
    x <- sapply(cells, function(one) indicator(cell, one))
    common <- Filter(function(k) all(paste(arms, k) %in% cells), seq_along(visits))
    weights <- lapply(arms, function(a) (cells %in% paste(a, common)) / length(common))
    first <- sapply(people, `[`, 1)
    baseline <- number(rows$baseline)[first]
    spread <- sqrt(mean((baseline - mean(baseline, na.rm = TRUE))^2, na.rm = TRUE))
    if (sum(!is.na(baseline)) < 2 || !(spread > 0)) baseline <- baseline * NA else {
      baseline <- (baseline - mean(baseline, na.rm = TRUE)) / spread
    }
    baseline[is.na(baseline)] <- 0
    covariates <- cbind(baseline)
    for (name in grep("^stratum_", names(rows), value = TRUE)) {
      level <- rows[[name]][first]
      for (one in sort(unique(level))[-1]) {
        covariates <- cbind(covariates, indicator(level, one) - mean(level == one))
      }
    }
    x <- cbind(x, covariates[match(rows$participant, names(people)), , drop = FALSE])
    weights <- lapply(weights, function(w) c(w, rep(0, ncol(covariates))))
    arm_of <- rows$arm[first]
    enough <- min(table(factor(arm_of, arms))) >= 3
    within <- function(of, a) Map(function(m, arm) m * (arm == a), of, arm_of)
    parts <- if (!enough) list(own, alike) else {
      c(lapply(arms, function(a) within(own, a)), lapply(arms, function(a) within(alike, a)))
    }
    diagonal <- rep(c(TRUE, FALSE), each = length(parts) / 2)
  }
  units <- lapply(seq_along(people), function(i) {
    list(x = x[people[[i]], , drop = FALSE], y = rows$value[people[[i]]],
         parts = lapply(parts, function(part) part[[i]]))
  })
  list(fit = fit(units, diagonal), weights = setNames(weights, arms))
}

outcomes <- read("outcomes.csv")
stored <- read("differences.csv")
crossover <- any(stored$paired == "true")
worst <- 0
for (slug in unique(stored$outcome)) {
  wanted <- stored[stored$outcome == slug & stored$low_95 != "", ]
  for (set in c("", "per_protocol_")) {
    rows <- outcomes[outcomes$outcome == slug & (set == "" | outcomes$per_protocol == "true"), ]
    known <- wanted[if (set == "") TRUE else wanted$per_protocol_low_95 != "", ]
    if (!nrow(known)) next
    labels <- unique(rows[c("arm", "group")])
    have <- labels$arm[labels$arm %in% rows$arm[rows$value != ""]]
    model <- model_of(rows[rows$arm %in% have, ], have, crossover)
    for (i in seq_len(nrow(known))) {
      pair <- sapply(c("group", "reference"), function(n) labels$arm[labels$group == known[i, n]])
      found <- estimate(model$fit, model$weights[[pair[1]]] - model$weights[[pair[2]]])
      names <- c(paste0(set, c("difference", "low_95", "high_95")), if (set == "") "p")
      cat(slug, set, known$group[i], "-", known$reference[i], format(found, digits = 10), "\n")
      off <- abs(found[seq_along(names)] - number(unlist(known[i, names])))
      worst <- max(worst, off / pmax(1, abs(found[seq_along(names)])))
    }
  }
}
cat("Largest relative difference to differences.csv:", format(worst, digits = 3), "\n")
quit(status = as.integer(worst > 1e-6))
