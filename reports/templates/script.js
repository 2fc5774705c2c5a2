(function () {
  'use strict';
  var all = function (what, where) { return Array.from((where || document).querySelectorAll(what)); };
  var units = { s: 1, ms: 1e-3, 'µs': 1e-6 };

  // the number that a cell is sorted by: its unit counts, what is no number comes last
  function value(cell) {
    var text = cell.textContent.trim().replace(/^< */, '');
    var found = /^[-+]?[\d.]+(e[-+]?\d+)?/i.exec(text);
    if (!found) { return null; }
    return parseFloat(found[0]) * (units[text.slice(found[0].length).trim()] || 1);
  }

  function sort(table, column, up) {
    var rows = all('tbody tr', table).map(function (row, place) {
      return { row: row, place: place, number: value(row.cells[column]), text: row.cells[column].textContent };
    });
    rows.sort(function (a, b) {
      if ((a.number === null) !== (b.number === null)) { return a.number === null ? 1 : -1; }
      var order = a.number === null ? a.text.localeCompare(b.text) : a.number - b.number;
      return (up ? order : -order) || a.place - b.place;
    });
    rows.forEach(function (entry) { table.tBodies[0].append(entry.row); });
  }

  all('table.cards').forEach(function (table) {
    all('thead th', table).forEach(function (head, column) {
      var button = document.createElement('button');
      button.type = 'button';
      button.append.apply(button, Array.from(head.childNodes));
      head.append(button);
      button.addEventListener('click', function () {
        var up = head.getAttribute('aria-sort') !== 'ascending';
        all('th', table).forEach(function (other) { other.removeAttribute('aria-sort'); });
        head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
        sort(table, column, up);
      });
    });
    if (table.tBodies[0].rows.length > 12) { filter(table); }
  });

  function filter(table) {
    var field = document.createElement('input');
    field.type = 'search';
    field.className = 'filter';
    field.placeholder = 'rows with …';
    field.setAttribute('aria-label', 'Show only the rows that contain this text');
    table.parentNode.before(field);
    field.addEventListener('input', function () {
      var wanted = field.value.toLowerCase();
      all('tbody tr', table).forEach(function (row) {
        row.hidden = row.textContent.toLowerCase().indexOf(wanted) < 0;
      });
    });
  }

  // mechanisms: their motion is held and goes on
  all('.hold input').forEach(function (box) {
    box.addEventListener('change', function () {
      all('svg.mechanism', box.closest('figure')).forEach(function (svg) {
        if (box.checked) { svg.pauseAnimations(); } else { svg.unpauseAnimations(); }
      });
    });
  });

  // figures: the run pointed at is read out, engines are switched
  all('figure.asked').forEach(function (figure) {
    var read = figure.querySelector('.read');
    var idle = read.textContent;
    all('.run', figure).forEach(function (run) {
      var say = function () { read.textContent = run.getAttribute('aria-label'); };
      var hush = function () { read.textContent = idle; };
      run.addEventListener('mouseenter', say);
      run.addEventListener('focus', say);
      run.addEventListener('mouseleave', hush);
      run.addEventListener('blur', hush);
    });
    all('.legend input', figure).forEach(function (box) {
      box.hidden = false;
      box.addEventListener('change', function () {
        all('g[data-engine]', figure).forEach(function (group) {
          if (group.dataset.engine === box.value) { group.toggleAttribute('hidden', !box.checked); }
        });
      });
    });
  });

  // records: the one asked for is opened; its commands can be copied
  function open() {
    var found = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    var closed = found && found.closest('details');
    if (closed) { closed.open = true; found.scrollIntoView(); }
  }
  addEventListener('hashchange', open);
  open();
  if (navigator.clipboard) {
    all('.command').forEach(function (block) {
      var button = document.createElement('button');
      button.type = 'button';
      button.className = 'copy';
      button.textContent = 'Copy';
      block.after(button);
      button.addEventListener('click', function () {
        navigator.clipboard.writeText(block.textContent.trim()).then(function () { button.textContent = 'Copied'; });
      });
    });
  }
})();
