// The theme before the first paint; a plain script, so that it runs ahead of the modules.
try {
  const chosen = localStorage.getItem("elea.theme");
  if (chosen === "dark" || chosen === "light") document.documentElement.dataset.theme = chosen;
} catch { /* a browser without storage follows the system */ }
