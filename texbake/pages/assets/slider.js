"use strict";
// Two pictures of one view over each other, with a border between them that can be moved.
(function () {
  const section = document.getElementById("compare");
  const stage = section.querySelector(".stage"), wipe = section.querySelector("[name=wipe]");
  const pictures = { before: section.querySelector(".before"), after: section.querySelector(".after") };
  const caption = section.querySelector(".caption");
  const split = function () { stage.style.setProperty("--split", wipe.value / 10 + "%"); };
  const show = function () {
    const label = section.querySelector("[name=view]:checked").parentElement;
    const small = label.querySelector("img");
    pictures.after.src = small.src;
    pictures.before.src = small.dataset.before;
    stage.style.setProperty("--shape", small.naturalWidth / small.naturalHeight || 1);
    caption.textContent = small.alt + ": " + label.querySelector("span").textContent;
  };
  const drag = function (event) {
    const box = stage.getBoundingClientRect();
    wipe.value = Math.round(1000 * (event.clientX - box.left) / box.width);
    split();
  };
  stage.addEventListener("pointerdown", function (event) {
    stage.setPointerCapture(event.pointerId);
    drag(event);
    event.preventDefault();
  });
  stage.addEventListener("pointermove", function (event) {
    if (stage.hasPointerCapture(event.pointerId)) drag(event);
  });
  wipe.addEventListener("input", split);
  section.querySelector(".views").addEventListener("input", show);
  split();
  show();
  section.dataset.state = "ready";
})();
