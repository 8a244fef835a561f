// Figures from the server: the static drawing that is sent with the data is shown first and becomes
// interactive once it is visible.
const shownFigures=new Map(); // host element → address of its figure
// shows the figure at an address in an element; requests the same address again only with `again`
async function picture(host,path,again=false){
  if(shownFigures.get(host)===path&&!again)return;
  shownFigures.set(host,path);
  const answer=await ask(path);
  if(shownFigures.get(host)!==path||!host.isConnected)return;
  if(!answer){host.replaceChildren(Object.assign(document.createElement('p'),{className:'absent',textContent:'No data for this figure yet.'}));return}
  const views=keepViews(answer.figure.name);
  alive.delete(answer.figure.name);
  // trusted markup: the program has escaped every name from a file
  const made=new DOMParser().parseFromString(answer.html,'text/html').body.firstElementChild;
  host.replaceChildren(document.adoptNode(made));
  const charts=enliven(made,answer.figure);
  views.forEach((view,i)=>{const chart=charts[i];if(view&&chart instanceof Chart)chart.zoom(view)});
  keysOf(made,answer.figure);
}
// keeps the zoom when new data arrive
function keepViews(name){
  const same=(a,b)=>a[0]===b[0]&&a[1]===b[1];
  return(alive.get(name)||[]).map(c=>c instanceof Chart&&!(same(c.view.x,c.panel.x.range)&&same(c.view.y,c.panel.y.range))?{x:c.view.x,y:c.view.y}:null);
}
